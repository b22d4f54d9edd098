//! The program as a whole, in processes of its own.

// Helpers beside the tests fail them in the same way.
#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

mod advice;
mod analytic;
mod better;
mod browser;
mod captured;
mod cells;
mod coming_and_going;
mod disk;
mod display_only;
mod export;
mod fault_loop;
mod fill;
mod forget;
mod haze;
mod headset;
mod hostile;
mod interrupted;
mod light;
mod links;
mod live;
mod log;
mod metrics;
mod network;
mod objects;
mod optimize;
mod page;
mod processes;
mod render_cache;
mod restart;
mod samples;
mod session;
mod several_machines;
mod shards;
mod siege;
mod sky_and_lamps;
mod stand_ins;
mod tracing_time;
mod unseen;
mod usage;
mod view_types;
mod virtual_distance;
mod wall;
mod watchers;
mod window;
mod worker_deaths;
