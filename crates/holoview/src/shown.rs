//! A view that is shown, and what has arrived for it.

use std::{path::PathBuf, time::Instant};

use anyhow::{Context, Result};
use holo_picture::View;
use holo_proto::bulk::{LiveSamples, Samples, Source, Unseen, WantedBeam};
use holo_section::BeamId;

use crate::{PictureReport, canvas::Canvas, live::Live, received::Received};

/// A view and what has arrived for it.
pub struct Shown {
    pub view: View,
    pub size: (u32, u32),
    pub wanted: Vec<WantedBeam>,
    /// Distance of the nearest visible surface, as far as it is known.
    pub nearest: f64,
    pub canvas: Canvas,
    /// Rays that no section covers, if something traces.
    pub live: Option<Live>,
    /// How far its samples have been asked for.
    pub asked: Asked,
    /// Beams that it does not cross but whose rays may end on what it sees, once they have been asked for.
    pub also: Vec<(u16, BeamId)>,
    /// Number of its first request: samples of earlier views are dropped.
    pub first_request: u32,
    pub received: Received,
    pub since: Instant,
    pub stored: u64,
    /// Of these, by section.
    pub stored_of: Vec<u64>,
    pub traced: u64,
    pub first_samples: Option<f64>,
    pub refined: bool,
    /// When single rays were last asked for; `None`: the driver asks for none.
    pub rays_asked: Option<Instant>,
}

impl Shown {
    /// Adds samples that were sent for it, but for those that it has.
    pub fn insert(&mut self, message: &Samples) {
        self.first_samples.get_or_insert_with(|| self.since.elapsed().as_secs_f64());
        for (run, samples) in message.iter() {
            for fresh in self.received.add(run) {
                let count = fresh.len() as u64;
                let fresh = &samples[fresh];
                self.canvas.insert(run.key.section, run.key.beam, run.paths, fresh);
                if let Some(live) = &mut self.live {
                    live.insert_samples(run.key.section, run.key.beam, run.paths, fresh);
                }
                match message.source {
                    Source::Stored => {
                        self.stored += count;
                        if let Some(of) = self.stored_of.get_mut(usize::from(run.key.section)) {
                            *of += count;
                        }
                    }
                    Source::Traced => self.traced += count,
                }
            }
        }
    }

    /// Adds beams sent for it whose rays meet nothing.
    pub fn insert_unseen(&mut self, message: &Unseen) {
        message.beams.iter().for_each(|key| self.canvas.insert_unseen(key.section, key.beam));
    }

    /// Adds live rays, if they are its own: those of earlier views are of no use.
    pub fn insert_live(&mut self, message: &LiveSamples) {
        if let Some(live) = self.live.as_mut().filter(|_| message.view == self.first_request) {
            live.insert(&self.canvas, &message.samples);
        }
    }

    /// Stored samples of a beam of each section, by those of the view's own beams; of a section that it does not cross, by all. At
    /// least one.
    pub fn samples_of_beam(&self) -> Vec<f64> {
        let mut beams = vec![0_u64; self.stored_of.len()];
        for wanted in &self.wanted {
            if let Some(beams) = beams.get_mut(usize::from(wanted.key.section)) {
                *beams += 1;
            }
        }
        let share = |stored: u64, beams: u64| (stored as f64 / beams.max(1) as f64).max(1.0);
        let all = share(self.stored, self.wanted.len() as u64);
        let of = |(&stored, &beams)| if beams == 0 { all } else { share(stored, beams) };
        self.stored_of.iter().zip(&beams).map(of).collect()
    }

    /// Draws the view as it is known and writes the picture; says what it is made of.
    pub fn write(&self, path: PathBuf) -> Result<PictureReport> {
        let (mut frame, guessed_pixels, stages) = self.canvas.draw();
        if let Some(live) = &self.live {
            live.paint(&mut frame);
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .with_context(|| format!("making {}", folder.display()))?;
        }
        frame.picture.write(&path).with_context(|| format!("writing {}", path.display()))?;
        Ok(PictureReport {
            picture: path,
            seconds: self.since.elapsed().as_secs_f64(),
            samples: frame.samples_used,
            stored: self.stored,
            traced: self.traced,
            live: self.live.as_ref().map_or(0, Live::shown),
            beams: self.wanted.len(),
            uncovered_pixels: frame.uncovered_pixels,
            empty_pixels: frame.empty_pixels,
            unseen_pixels: frame.unseen_pixels,
            guessed_pixels,
            driver: self.canvas.name(),
            first_samples: self.first_samples,
            stages,
        })
    }
}

/// Which stored samples of a view have been asked for.
#[derive(Clone, Copy, PartialEq)]
pub enum Asked {
    /// Those of the beams that it crosses.
    Crossed,
    /// And of some beams that end on what it sees, which hold the most.
    Best,
    /// And of all beams that end on what it sees.
    Surfaces,
    /// All that there are.
    All,
}
