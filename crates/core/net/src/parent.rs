//! The link between a process and the program that started it: one socket, which is the child's
//! standard input.
//!
//! The child writes reports, each a line of JSON of a type that both programs know. The parent
//! writes [`AGAIN`](crate::AGAIN) or nothing, and closes the socket when the child is to end.
//! A parent that is killed closes it too.

use std::{
    io::{self, Write},
    marker::PhantomData,
    os::{
        fd::{AsFd, OwnedFd},
        unix::net::UnixStream,
    },
};

use serde::{Serialize, de::DeserializeOwned};
use tokio::{
    io::{AsyncBufReadExt, BufReader, Lines},
    net::unix::{OwnedReadHalf, OwnedWriteHalf},
};

/// The child's end.
#[derive(Debug)]
pub struct ParentLink(UnixStream);

impl ParentLink {
    /// Returns the link to the program that started this process.
    ///
    /// # Errors
    /// If standard input is no socket, because another program has started this process.
    pub fn of_standard_input() -> io::Result<ParentLink> {
        let socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
        socket.peer_addr()?;
        Ok(ParentLink(socket))
    }

    /// Sends a report. A parent that is gone needs none, so failures are ignored.
    pub fn report(&self, report: &impl Serialize) {
        if let Ok(mut line) = serde_json::to_vec(report) {
            line.push(b'\n');
            let _ = (&self.0).write_all(&line);
        }
    }
}

/// The parent's end, from which it reads reports of type `T`.
#[derive(Debug)]
pub struct ChildReports<T> {
    lines: Lines<BufReader<OwnedReadHalf>>,
    report: PhantomData<fn() -> T>,
}

impl<T: DeserializeOwned> ChildReports<T> {
    /// Waits for the next report; `None` once the child has ended. A call that is dropped half-way
    /// loses nothing.
    ///
    /// # Errors
    /// If the child's words are no report, or the system's.
    pub async fn next(&mut self) -> io::Result<Option<T>> {
        let line = self.lines.next_line().await?;
        Ok(line.map(|line| serde_json::from_str(&line)).transpose()?)
    }
}

/// Returns a child's standard input, the reports that it will send, and the end that the parent
/// closes to end the child. Must be called within a tokio runtime.
///
/// # Errors
/// If the system has no socket left.
pub fn child_link<T>() -> io::Result<(OwnedFd, ChildReports<T>, OwnedWriteHalf)> {
    let (ours, childs) = UnixStream::pair()?;
    ours.set_nonblocking(true)?;
    let (reading, writing) = tokio::net::UnixStream::from_std(ours)?.into_split();
    let lines = BufReader::new(reading).lines();
    Ok((childs.into(), ChildReports { lines, report: PhantomData }, writing))
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use tokio::io::AsyncWriteExt;

    use super::*;

    #[tokio::test]
    async fn reports_arrive_in_order_and_words_of_the_parent_end_with_its_end() {
        let (input, mut reports, mut end) = child_link::<(u32, String)>().unwrap();
        let child = ParentLink(UnixStream::from(input));
        let sent = [(1, "loading\nhalf".to_owned()), (2, "ready".to_owned())];
        sent.iter().for_each(|report| child.report(report));
        for report in sent {
            assert_eq!(reports.next().await.unwrap(), Some(report));
        }
        end.write_all(b"again\n").await.unwrap();
        drop(end);
        let mut words = String::new();
        (&child.0).read_to_string(&mut words).unwrap();
        assert_eq!(words, "again\n");
        drop(child);
        assert_eq!(reports.next().await.unwrap(), None);
    }

    #[tokio::test]
    async fn words_that_are_no_report_are_an_error() {
        let (input, mut reports, _end) = child_link::<u32>().unwrap();
        let child = ParentLink(UnixStream::from(input));
        child.report(&"seven");
        assert!(reports.next().await.is_err());
    }
}
