//! What a stage is begun with.

use holo_options::ViewArgs;
use holo_session::Crew;

/// Options of a stage.
pub struct Wishes {
    /// The first view and the size, as on the command line.
    pub view: ViewArgs,
    /// The file that the walk is recorded in, as a script.
    pub record: Option<std::path::PathBuf>,
    /// The crew that started server and workers, if it takes orders.
    pub crew: Option<Crew>,
}
