//! The views where the eye stayed, for walking back and forward through them.

use holo_picture::ViewSpec;

/// Largest number of views. A day's walk needs no more.
const MOST: usize = 100;

/// Views before and after the current one, the nearest last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    before: Vec<ViewSpec>,
    after: Vec<ViewSpec>,
}

impl History {
    /// Adds `view`, which the eye leaves for a new view. Forgets the views after it.
    pub fn leave(&mut self, view: ViewSpec) {
        self.after.clear();
        if self.before.last() == Some(&view) {
            return;
        }
        if self.before.len() == MOST {
            self.before.remove(0);
        }
        self.before.push(view);
    }

    /// Returns the view before `current`, which then comes after it.
    pub fn back(&mut self, current: ViewSpec) -> Option<ViewSpec> {
        let view = loop {
            let view = self.before.pop()?;
            if view != current {
                break view;
            }
        };
        self.after.push(current);
        Some(view)
    }

    /// Returns the view after `current`, which then comes before it.
    pub fn forward(&mut self, current: ViewSpec) -> Option<ViewSpec> {
        let view = self.after.pop()?;
        self.before.push(current);
        Some(view)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn view(x: f64) -> ViewSpec {
        ViewSpec { vp: Some(DVec3::X * x), ..ViewSpec::default() }
    }

    #[test]
    fn walking_back_and_forward_works_and_a_new_view_forgets_later_ones() {
        let mut history = History::default();
        history.leave(view(1.0));
        history.leave(view(2.0));
        assert_eq!(history.back(view(3.0)), Some(view(2.0)));
        assert_eq!(history.back(view(2.0)), Some(view(1.0)));
        assert_eq!(history.back(view(1.0)), None);
        assert_eq!(history.forward(view(1.0)), Some(view(2.0)));
        history.leave(view(2.0));
        assert_eq!(history.forward(view(4.0)), None);
        assert_eq!(history.back(view(4.0)), Some(view(2.0)));
    }

    #[test]
    fn it_keeps_a_bounded_number_of_views() {
        let mut history = History::default();
        (0..1000).for_each(|x| history.leave(view(f64::from(x))));
        let mut steps = 0;
        while history.back(view(-1.0 - f64::from(steps))).is_some() {
            steps += 1;
        }
        assert_eq!(steps, 100);
    }
}
