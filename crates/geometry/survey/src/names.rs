//! Recognises surfaces by words in the names of their materials.

/// Words of surfaces that lie level, in the languages of common exporters.
const LEVEL: [&str; 20] = [
    "floor",
    "ground",
    "ceiling",
    "carpet",
    "parquet",
    "grass",
    "lawn",
    "terrain",
    "pavement",
    "boden",
    "decke",
    "parkett",
    "rasen",
    "sol",
    "plafond",
    "moquette",
    "piso",
    "suelo",
    "techo",
    "pavimento",
];

/// Returns true if a name means a level surface.
pub(crate) fn is_level(name: &str) -> bool {
    let lower = name.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphabetic());
    words.any(|word| {
        LEVEL.iter().any(|level| word == *level || word.strip_suffix('s') == Some(level))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_count_only_as_a_whole() {
        assert!(is_level("wood_floor") && is_level("Ceiling.001") && is_level("Floors"));
        assert!(!is_level("solid") && !is_level("flooring2d") && !is_level("wall"));
    }
}
