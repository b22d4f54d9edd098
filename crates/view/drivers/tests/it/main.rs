//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod clipping;
#[path = "../../../../show/driver-quadtree/tests/it/common/mod.rs"]
mod common;
mod live;
mod portals;
mod view_types;
#[path = "../../../../show/display/tests/common/viewer.rs"]
mod viewer;
