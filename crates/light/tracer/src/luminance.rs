//! Luminance: the weight of a colour in random choices.

pub(crate) use holo_color::relative_luminance as luminance;
