/* Measures rays per second of Embree's rtcIntersect1 and rtcOccluded1 in a plain loop of one thread,
   on a dump of the `rays` example. Declares the used part of Embree 4's interface, because wheels
   contain the library without its headers. */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void* Handle;
struct Ray { float org[3], tnear, dir[3], time, tfar; unsigned mask, id, flags; };
struct Hit { float ng[3], u, v; unsigned prim, geom, inst[8]; };
struct RayHit { struct Ray ray; struct Hit hit; } __attribute__((aligned(16)));

static void* library;
static void* symbol(const char* name) {
    void* found = dlsym(library, name);
    if (!found) { fprintf(stderr, "embree-bench: no %s in the library\n", name); exit(1); }
    return found;
}
static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}
static void* take(FILE* file, size_t bytes) {
    void* memory = aligned_alloc(64, (bytes + 127) / 64 * 64);
    if (!memory || fread(memory, 1, bytes, file) != bytes) { fprintf(stderr, "embree-bench: the dump is cut short\n"); exit(1); }
    return memory;
}

static void (*intersect1)(Handle, struct RayHit*, void*);
static void (*occluded1)(Handle, struct Ray*, void*);

static void load(struct Ray* ray, const float* from, int occlusion) {
    memcpy(ray->org, from, 12);
    memcpy(ray->dir, from + 3, 12);
    ray->tnear = from[6];
    ray->tfar = occlusion ? 1.0f : from[7];
    ray->time = 0; ray->mask = ~0u; ray->id = 0; ray->flags = 0;
}

static void measure(Handle scene, const char* name, const float* rays, unsigned count, int occlusion) {
    double best = INFINITY;
    size_t hits = 0;
    for (int run = 0; run < 3; run++) {
        hits = 0;
        double start = seconds();
        for (unsigned i = 0; i < count; i++) {
            struct RayHit it;
            load(&it.ray, rays + 8 * (size_t)i, occlusion);
            if (occlusion) {
                occluded1(scene, &it.ray, NULL);
                hits += it.ray.tfar < 0;
            } else {
                it.hit.geom = ~0u; it.hit.inst[0] = ~0u;
                intersect1(scene, &it, NULL);
                hits += it.hit.geom != ~0u;
            }
        }
        double taken = seconds() - start;
        if (taken < best) best = taken;
    }
    printf(",\"%s\":%.4f,\"%s_count\":%zu", name, count / best / 1e6, name, hits);
}

int main(int argc, char** argv) {
    if (argc < 4) { fprintf(stderr, "usage: embree-bench LIBRARY DUMP default|robust\n"); return 2; }
    library = dlopen(argv[1], RTLD_NOW);
    if (!library) { fprintf(stderr, "embree-bench: %s\n", dlerror()); return 1; }
    FILE* file = fopen(argv[2], "rb");
    if (!file) { perror(argv[2]); return 1; }
    unsigned* counts = take(file, 16);
    unsigned vertices = counts[0], triangles = counts[1];
    /* Embree may read up to 16 bytes past the last vertex: `take` leaves at least 64. */
    float* positions = take(file, 12 * (size_t)vertices);
    unsigned* indices = take(file, 12 * (size_t)triangles);
    float* incoherent = take(file, 32 * (size_t)counts[2]);
    float* beams = take(file, 32 * (size_t)counts[3]);
    fclose(file);

    Handle device = ((Handle(*)(const char*))symbol("rtcNewDevice"))("threads=1");
    Handle scene = ((Handle(*)(Handle))symbol("rtcNewScene"))(device);
    if (!strcmp(argv[3], "robust")) ((void (*)(Handle, int))symbol("rtcSetSceneFlags"))(scene, 4);
    Handle geometry = ((Handle(*)(Handle, int))symbol("rtcNewGeometry"))(device, 0);
    void (*share)(Handle, int, unsigned, int, const void*, size_t, size_t, size_t) = symbol("rtcSetSharedGeometryBuffer");
    share(geometry, 1, 0, 0x9003, positions, 0, 12, vertices);
    share(geometry, 0, 0, 0x5003, indices, 0, 12, triangles);
    ((void (*)(Handle))symbol("rtcCommitGeometry"))(geometry);
    ((unsigned (*)(Handle, Handle))symbol("rtcAttachGeometry"))(scene, geometry);
    struct timespec a, b;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
    ((void (*)(Handle))symbol("rtcCommitScene"))(scene);
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
    int error = ((int (*)(Handle))symbol("rtcGetDeviceError"))(device);
    if (error) { fprintf(stderr, "embree-bench: Embree's error %d\n", error); return 1; }
    intersect1 = symbol("rtcIntersect1");
    occluded1 = symbol("rtcOccluded1");

    printf("{\"triangles\":%u,\"build_seconds\":%.3f", triangles, b.tv_sec - a.tv_sec + 1e-9 * (b.tv_nsec - a.tv_nsec));
    measure(scene, "nearest", incoherent, counts[2], 0);
    measure(scene, "occluded", incoherent, counts[2], 1);
    measure(scene, "beam_nearest", beams, counts[3], 0);
    measure(scene, "beam_occluded", beams, counts[3], 1);
    printf("}\n");
    return 0;
}
