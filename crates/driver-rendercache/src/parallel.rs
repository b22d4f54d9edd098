//! Runs the parts of a stage on several threads.
//!
//! Always true: all parts are done when it returns, each once; with one part no thread is started.

use std::thread;

/// Runs `work` on every part, the first on this thread.
pub(super) fn for_each<T: Send>(parts: Vec<T>, work: impl Fn(T) + Sync) {
    for_each_telling(parts, &mut |()| {}, |part, _| work(part));
}

/// As [`for_each`], with something that only this thread's part may call.
pub(super) fn for_each_telling<T: Send, S>(
    parts: Vec<T>,
    tell: &mut dyn FnMut(S),
    work: impl Fn(T, &mut dyn FnMut(S)) + Sync,
) {
    let all = &work;
    let work = &|part| all(part, &mut |_| {});
    thread::scope(|scope| {
        let mut parts = parts.into_iter();
        let Some(first) = parts.next() else { return };
        for part in parts {
            // The part travels in a slot, so that it is not lost if the system has no more threads: then it is done here.
            let slot = std::sync::Arc::new(std::sync::Mutex::new(Some(part)));
            let theirs = std::sync::Arc::clone(&slot);
            let take = move || theirs.lock().ok().and_then(|mut part| part.take());
            let started =
                thread::Builder::new().spawn_scoped(scope, move || take().map(work)).is_ok();
            if let Some(part) =
                slot.lock().ok().filter(|_| !started).and_then(|mut part| part.take())
            {
                work(part);
            }
        }
        all(first, tell);
    });
}

/// Where to cut `count` rows for `parts` threads, at multiples of `unit`: the rows of each part, none empty.
pub(super) fn bands(count: usize, unit: usize, parts: usize) -> Vec<std::ops::Range<usize>> {
    let units = count.div_ceil(unit);
    let parts = parts.clamp(1, units.max(1));
    (0..parts)
        .map(|part| {
            (units * part / parts * unit).min(count)..(units * (part + 1) / parts * unit).min(count)
        })
        .collect()
}

/// Cuts a slice into consecutive pieces of these lengths.
pub(super) fn cut<T>(mut slice: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    lengths
        .map(|length| {
            let (piece, rest) = std::mem::take(&mut slice).split_at_mut(length);
            slice = rest;
            piece
        })
        .collect()
}
