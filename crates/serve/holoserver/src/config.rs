//! Options of the server, and the texts of their values.

use std::{path::PathBuf, time::Duration};

use clap::Args;

use crate::shard::Shard;

/// Options of `holoserver`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Example:\n  holoserver room.holo --listen 127.0.0.1:7070 --fill --time 30m"
)]
pub struct Config {
    /// The holodeck to serve
    #[arg(value_name = "FILE.holo")]
    pub file: PathBuf,
    /// Where to listen; port 0 takes any free port. The address is printed. If other machines
    /// can reach the address, connections are encrypted, and only peers with the printed string may
    /// connect: workers and displays
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7070")]
    pub listen: String,
    /// Encrypt connections and ask for a token even on this machine, as for a tunnel
    #[arg(long)]
    pub secure: bool,
    /// The address in the printed string, if others see this machine under another one
    #[arg(long, value_name = "HOST:PORT")]
    pub public: Option<String>,
    /// Folder of the certificate and the tokens [default: holodeck/server in the user's
    /// configuration folder]
    #[arg(long, value_name = "DIR")]
    pub identity: Option<PathBuf>,
    /// A certificate to use in place of the one that is made: a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "key")]
    pub cert: Option<PathBuf>,
    /// The certificate's key, a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "cert")]
    pub key: Option<PathBuf>,
    /// Memory for beams that are kept at hand, MiB
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = parse_memory)]
    pub cache: u64,
    /// Fill the file in batch order while no display wants anything
    #[arg(long)]
    pub fill: bool,
    /// End after tracing for so long, such as 30s, 10m or 8h; loading does not count
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    pub time: Option<Duration>,
    /// Enough samples for the file, such as 60M, or 0 for no new ones. Then known samples are
    /// traced again with more paths [default: 512 for each beam that sees something, at least 50M]
    #[arg(long, value_name = "N", value_parser = parse_count, requires = "fill")]
    pub enough: Option<u64>,
    /// End after so many samples, such as 20M; those traced again count
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub samples: Option<u64>,
    /// End before the file is longer than this, such as 500MB or 50GB
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub disk: Option<u64>,
    /// Fill only the beams of this share, such as 0/8: the first of eight
    #[arg(long, value_name = "I/N", requires = "fill")]
    pub shard: Option<Shard>,
    /// Fill only the beams in this list (made by the program that starts this one)
    #[arg(long, value_name = "FILE", requires = "fill", hide = true)]
    pub beams: Option<PathBuf>,
    /// Only show the file: do not write to it, and take no workers
    #[arg(long, conflicts_with_all = ["fill", "time", "samples", "disk"])]
    pub display_only: bool,
    /// Also trace beams whose rays cannot hit anything, for comparison
    #[arg(long)]
    pub no_skip_unseen: bool,
    /// Append what happens to this file: a JSON object in each line
    #[arg(long, value_name = "FILE")]
    pub log_file: Option<PathBuf>,
    /// Print a summary as JSON at the end
    #[arg(long)]
    pub json: bool,
    /// Print less
    #[arg(short, long)]
    pub quiet: bool,
    /// End when standard input ends (set by the program that starts this one)
    #[arg(long, hide = true)]
    pub with_parent: bool,
    /// Report to the program that started this one. Standard input is the link to it
    #[arg(long, hide = true, requires = "with_parent")]
    pub reports: bool,
}

impl Config {
    /// Returns the defaults for `file`, on any free port.
    pub fn new(file: PathBuf) -> Config {
        Config {
            file,
            listen: "127.0.0.1:0".into(),
            secure: false,
            public: None,
            identity: None,
            cert: None,
            key: None,
            cache: 256,
            fill: false,
            enough: None,
            time: None,
            samples: None,
            disk: None,
            shard: None,
            beams: None,
            display_only: false,
            no_skip_unseen: false,
            log_file: None,
            json: false,
            quiet: true,
            with_parent: false,
            reports: false,
        }
    }
}

/// Parses a time such as `30s`, `10m`, `8h`, or plain seconds.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_time(text: &str) -> Result<Duration, String> {
    let (number, factor) = match text.char_indices().next_back() {
        Some((at, 's')) => (&text[..at], 1.0),
        Some((at, 'm')) => (&text[..at], 60.0),
        Some((at, 'h')) => (&text[..at], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number.parse::<f64>().ok().filter(|seconds| *seconds >= 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds * factor).ok());
    time.ok_or_else(|| format!("`{text}` is not a time; write 30s, 10m or 8h"))
}

/// Parses a count such as `500k`, `20M`, `1.5G`, or a plain number.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_count(text: &str) -> Result<u64, String> {
    let (number, factor) = match text.char_indices().next_back() {
        Some((at, 'k')) => (&text[..at], 1e3),
        Some((at, 'M')) => (&text[..at], 1e6),
        Some((at, 'G')) => (&text[..at], 1e9),
        _ => (text, 1.0),
    };
    let count = number.parse::<f64>().ok().map(|count| count * factor);
    let count = count.filter(|count| (0.0..1e18).contains(count));
    count
        .map(|count| count as u64)
        .ok_or_else(|| format!("`{text}` is not a count; write 500k, 20M or 1G"))
}

/// Units of lengths of files and memory, bytes. Units that end with another one come first.
const BYTE_UNITS: [(&str, f64); 10] = [
    ("KiB", 1024.0),
    ("MiB", 1_048_576.0),
    ("GiB", 1_073_741_824.0),
    ("TiB", 1_099_511_627_776.0),
    ("kB", 1e3),
    ("KB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("TB", 1e12),
    ("B", 1.0),
];

/// Most memory that can be stated, MiB: 16 TiB.
const MOST_MEBIBYTES: f64 = 16_777_216.0;

/// Parses a length of files such as `500MB`, `50GiB`, or plain bytes.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_size(text: &str) -> Result<u64, String> {
    bytes(text, 1.0)
        .filter(|bytes| (0.0..1e18).contains(bytes))
        .map(|bytes| bytes as u64)
        .ok_or_else(|| format!("`{text}` is not a size; write 500MB, 50GB or 50GiB"))
}

/// Parses an amount of memory, such as `512`, `512MiB` or `2GiB`, and returns it in MiB. A plain
/// number is in MiB.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_memory(text: &str) -> Result<u64, String> {
    let mebibyte = 1_048_576.0;
    bytes(text, mebibyte)
        .map(|bytes| (bytes / mebibyte).ceil())
        .filter(|mebibytes| (0.0..=MOST_MEBIBYTES).contains(mebibytes))
        .map(|mebibytes| mebibytes as u64)
        .ok_or_else(|| {
            format!("`{text}` is not an amount of memory; write 512 (MiB) or 2GiB, at most 16TiB")
        })
}

/// Returns the number of bytes in a text with a unit, or with `plain` if it has none.
fn bytes(text: &str, plain: f64) -> Option<f64> {
    let with_unit = |(unit, factor)| Some((text.strip_suffix(unit)?, factor));
    let (number, factor) = BYTE_UNITS.into_iter().find_map(with_unit).unwrap_or((text, plain));
    number.trim().parse::<f64>().ok().map(|number| number * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units_of_ten_and_of_two() {
        for (text, bytes) in [
            ("500MB", 500_000_000),
            ("5MiB", 5 << 20),
            ("1.5 GiB", 3 << 29),
            ("2KiB", 2048),
            ("1TiB", 1 << 40),
            ("3kB", 3000),
            ("7B", 7),
            ("12", 12),
        ] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for bad in ["", "MiB", "-1MB", "5 apples", "nan", "1e30GB"] {
            assert!(parse_size(bad).unwrap_err().contains("GiB"), "{bad}");
        }
        assert_eq!(parse_memory("256"), Ok(256));
        assert_eq!(parse_memory("2GiB"), Ok(2048));
        assert_eq!(parse_memory("1B"), Ok(1));
        for bad in ["-1", "1e9", "inf", "9e18", "17TiB"] {
            assert!(parse_memory(bad).unwrap_err().contains("16TiB"), "{bad}");
        }
    }
}
