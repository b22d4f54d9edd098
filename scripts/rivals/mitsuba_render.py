#!/usr/bin/env python3
"""Renders an OBJ scene with Mitsuba 3 and reports the time. Needs mitsuba and numpy.

usage: mitsuba_render.py SCENE.obj VARIANT VIEW_JSON SPP,SPP,... OUTPUT_PREFIX

VIEW_JSON: {"vp": [..], "vd": [..], "vu": [..], "vh": degrees, "size": [w, h],
"depth": max_depth or -1, "sky": [r, g, b]}

Prints a JSON line for each number of paths: {"spp": .., "seconds": .., "picture": ".."}. The first
rendering does not count: it compiles Mitsuba's kernels.
"""
import json
import math
import os
import sys
import time

import numpy as np


def read_mtl(path: str) -> dict[str, dict]:
    materials: dict[str, dict] = {}
    for line in open(path, encoding="utf-8"):
        words = line.split()
        if not words:
            continue
        if words[0] == "newmtl":
            current = materials.setdefault(" ".join(words[1:]), {})
        elif words[0] in ("Kd", "Ks", "Ke", "Tf"):
            current[words[0]] = [float(w) for w in words[1:4]]
        elif words[0] in ("Ns", "Ni"):
            current[words[0]] = float(words[1])
        elif words[0] == "illum":
            current["illum"] = int(words[1])
    return materials


def read_obj(path: str) -> tuple[np.ndarray, dict[str, list], dict[str, dict]]:
    """Returns vertices, triangles by material (as fans), and materials."""
    vertices: list = []
    faces: dict[str, list] = {}
    materials: dict[str, dict] = {}
    current = faces.setdefault("", [])
    for line in open(path, encoding="utf-8"):
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(w) for w in words[1:4]])
        elif words[0] == "f":
            corners = [int(w.split("/")[0]) for w in words[1:]]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            current.extend((corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1))
        elif words[0] == "usemtl":
            current = faces.setdefault(" ".join(words[1:]), [])
        elif words[0] == "mtllib":
            materials.update(read_mtl(os.path.join(os.path.dirname(path), " ".join(words[1:]))))
    return np.array(vertices), faces, materials


def bsdf(material: dict) -> dict:
    """Converts an OBJ material as README.md describes."""
    rgb = lambda key, default: {"type": "rgb", "value": material.get(key, default)}
    illum, shine = material.get("illum", 1), material.get("Ns", 1e9)
    if illum == 3 and shine >= 999:
        inner = {"type": "conductor", "material": "none", "specular_reflectance": rgb("Ks", [1, 1, 1])}
    elif illum == 3:
        alpha = math.sqrt(2 / (shine + 2))
        inner = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": alpha,
                 "specular_reflectance": rgb("Ks", [1, 1, 1])}
    elif illum == 4:
        return {"type": "thindielectric", "int_ior": material.get("Ni", 1.5), "specular_transmittance": rgb("Tf", [1, 1, 1])}
    elif illum == 7:
        return {"type": "dielectric", "int_ior": material.get("Ni", 1.5), "specular_transmittance": rgb("Tf", [1, 1, 1])}
    else:
        inner = {"type": "diffuse", "reflectance": rgb("Kd", [0.5, 0.5, 0.5])}
    return {"type": "twosided", "bsdf": inner}


def mesh(mi, name: str, vertices: np.ndarray, triangles: list, material: dict):
    used, index = np.unique(np.array(triangles), return_inverse=True)
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(bsdf(material))
    if max(material.get("Ke", [0])) > 0:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": material["Ke"]}})
    result = mi.Mesh(name, vertex_count=len(used), face_count=len(triangles), props=properties)
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = vertices[used].astype(np.float32).ravel()
    parameters["faces"] = index.astype(np.uint32).ravel()
    parameters.update()
    return result


def main() -> None:
    import mitsuba as mi

    path, variant, view, counts, prefix = sys.argv[1:]
    view = json.loads(view)
    mi.set_variant(variant)
    import drjit as dr

    vertices, faces, materials = read_obj(path)
    # Coordinates are relative to the scene's centre, as in this project. Single precision is finest
    # there.
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    vertices = vertices - middle
    eye = np.array(view["vp"]) - middle
    target = eye + np.array(view["vd"])
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": view.get("depth", -1), "rr_depth": 6},
        "sensor": {
            "type": "perspective", "fov": view["vh"], "fov_axis": "x", "near_clip": 1e-3, "far_clip": 1e7,
            "to_world": mi.ScalarTransform4f().look_at(origin=list(eye), target=list(target), up=view["vu"]),
            "film": {"type": "hdrfilm", "width": view["size"][0], "height": view["size"][1],
                     "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "independent"},
        },
    }
    for number, (name, triangles) in enumerate(faces.items()):
        if triangles:
            scene[f"mesh{number}"] = mesh(mi, name, vertices, triangles, materials.get(name, {}))
    if max(view.get("sky", [0])) > 0:
        scene["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": view["sky"]}}
    scene = mi.load_dict(scene)

    def render(spp: int, seed: int) -> tuple[np.ndarray, float]:
        start = time.perf_counter()
        image = np.array(mi.render(scene, spp=spp, seed=seed))
        dr.sync_thread()
        return image, time.perf_counter() - start

    for spp in map(int, counts.split(",")):
        # More paths than Mitsuba's wavefront holds are rendered in parts and averaged.
        part = min(spp, 64)
        render(part, 999)
        total, seconds = 0.0, 0.0
        for index in range(spp // part):
            image, took = render(part, index)
            total, seconds = total + image.astype(np.float64), seconds + took
        picture = f"{prefix}{spp}.pfm"
        mi.Bitmap((total / (spp // part)).astype(np.float32)).write(picture)
        print(json.dumps({"spp": spp, "seconds": seconds, "picture": picture}), flush=True)


if __name__ == "__main__":
    main()
