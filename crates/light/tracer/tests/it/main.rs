//! Tests of the public interface, in one program: each one compiles the same generic code again.

mod common;
mod covers;
mod daylight;
mod extremes;
mod gather;
mod housing;
mod instances;
mod light;
mod luminaires;
mod many_lights;
mod nested;
mod reference;
mod scale;
mod specular;
mod tracing;
mod variance;
mod virtual_distance;
