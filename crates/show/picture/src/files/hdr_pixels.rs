//! The scanlines of a Radiance picture: flat, with old runs (1 1 1 count), or with new runs
//! (channel by channel).
//!
//! Invariant: a reader consumes no more bytes than it is given, and fills exactly one row or
//! fails.

use crate::error::PictureError;

/// Longest run and longest literal of the newer encoding (Radiance color.c).
const MAX_RUN: usize = 127;
const MAX_LITERAL: usize = 128;

/// Shortest run worth its two bytes (Radiance color.c, MINRUN).
const MIN_RUN: usize = 4;

/// An error in a row.
pub(super) enum Fault {
    Truncated,
    Encoding(&'static str),
}

impl Fault {
    pub(super) fn at(self, row: u32, rows: u32) -> PictureError {
        match self {
            Fault::Truncated => PictureError::Truncated { row, rows },
            Fault::Encoding(what) => PictureError::Encoding { row, what },
        }
    }
}

/// Reads one row. `rle` is true if the width allows the newer encoding.
pub(super) fn read_row(rest: &mut &[u8], row: &mut [[u8; 4]], rle: bool) -> Result<(), Fault> {
    match rest {
        // A length of 2^15 or more is impossible; Radiance then takes these four bytes as a pixel.
        [2, 2, high, low, ..] if rle && *high < 128 => {
            if usize::from(*high) << 8 | usize::from(*low) != row.len() {
                return Err(Fault::Encoding("its length is not the picture's width"));
            }
            *rest = &rest[4..];
            (0..4).try_for_each(|channel| read_channel(rest, row, channel))
        }
        _ => read_old(rest, row),
    }
}

fn read_channel(rest: &mut &[u8], row: &mut [[u8; 4]], channel: usize) -> Result<(), Fault> {
    let mut at = 0;
    while at < row.len() {
        let code = usize::from(take::<1>(rest)?[0]);
        let count = if code > MAX_LITERAL { code - MAX_LITERAL } else { code };
        let target =
            row.get_mut(at..at + count).ok_or(Fault::Encoding("a run goes past its end"))?;
        if code > MAX_LITERAL {
            let [value] = take::<1>(rest)?;
            target.iter_mut().for_each(|pixel| pixel[channel] = value);
        } else {
            let (values, after) = rest.split_at_checked(count).ok_or(Fault::Truncated)?;
            target.iter_mut().zip(values).for_each(|(pixel, value)| pixel[channel] = *value);
            *rest = after;
        }
        at += count;
    }
    Ok(())
}

/// Reads flat pixels with old runs: 1 1 1 n repeats the previous pixel n times, and each following
/// run counts 256 times as much.
fn read_old(rest: &mut &[u8], row: &mut [[u8; 4]]) -> Result<(), Fault> {
    let (mut at, mut shift) = (0, 0);
    while at < row.len() {
        let pixel = take::<4>(rest)?;
        if pixel[..3] != [1, 1, 1] {
            row[at] = pixel;
            (at, shift) = (at + 1, 0);
            continue;
        }
        let last = *at
            .checked_sub(1)
            .and_then(|last| row.get(last))
            .ok_or(Fault::Encoding("it begins with a run"))?;
        if shift > 16 {
            return Err(Fault::Encoding("a run is longer than any row"));
        }
        // A run ends at the end of the row, as in Radiance.
        let end = row.len().min(at + (usize::from(pixel[3]) << shift));
        row[at..end].fill(last);
        (at, shift) = (end, shift + 8);
    }
    Ok(())
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], Fault> {
    let (bytes, after) = rest.split_first_chunk::<N>().ok_or(Fault::Truncated)?;
    *rest = after;
    Ok(*bytes)
}

/// Appends one row, in the newer encoding if `rle` (its length must then be below 2^15).
pub(super) fn write_row(bytes: &mut Vec<u8>, row: &[[u8; 4]], rle: bool) {
    if !rle {
        // Our pixels cannot be mistaken for runs: the largest mantissa is at least 128, except for
        // black.
        bytes.extend_from_slice(row.as_flattened());
        return;
    }
    bytes.extend_from_slice(&[2, 2, (row.len() >> 8) as u8, row.len() as u8]);
    for channel in 0..4 {
        write_channel(bytes, row, channel);
    }
}

fn write_channel(bytes: &mut Vec<u8>, row: &[[u8; 4]], channel: usize) {
    let run_at = |at: usize| {
        row[at..].iter().take(MAX_RUN).take_while(|p| p[channel] == row[at][channel]).count()
    };
    let mut at = 0;
    while at < row.len() {
        let run = run_at(at);
        if run >= MIN_RUN {
            bytes.extend_from_slice(&[(MAX_LITERAL + run) as u8, row[at][channel]]);
            at += run;
            continue;
        }
        let start = at;
        while at < row.len() && at - start < MAX_LITERAL && run_at_least(row, at, channel) < MIN_RUN
        {
            at += 1;
        }
        bytes.push((at - start) as u8);
        bytes.extend(row[start..at].iter().map(|pixel| pixel[channel]));
    }
}

/// Returns the length of the run that begins at `at`, but counts at most to [`MIN_RUN`]: literals
/// need it at every byte.
fn run_at_least(row: &[[u8; 4]], at: usize, channel: usize) -> usize {
    row[at..].iter().take(MIN_RUN).take_while(|pixel| pixel[channel] == row[at][channel]).count()
}
