#![allow(clippy::unwrap_used)]
use holo_scene::*;
#[test]
fn zz() {
    let mut files: Vec<std::path::PathBuf> = (0..40).map(|k| format!("/tmp/oldnew/t{k}.obj").into()).collect();
    files.push("/work/shared/scenes/cabin/cabin.obj".into());
    files.push("/work/shared/scenes/cornell/cornell.obj".into());
    for f in files {
        match load_obj(&f, &LoadOptions::default()) {
            Ok(l) => { println!("HASH {} {} {:?}", f.display(), l.scene.triangles.len(), Scene::content_hash(&l.scene.pack()));
              for w in l.warnings { println!("HASH   {w}"); } }
            Err(e) => println!("HASH {e}"),
        }
    }
}
