//! The scenes of the table of keeping: each a file of additions to one base, so that a further scene is a
//! further file.

use std::path::{Path, PathBuf};

use gangway_engine::LampMode;
use gangway_scene::Scene;
use toml::{Table, Value};

/// One scene of the folder.
#[derive(Clone, Debug)]
pub struct Keeping {
    /// Its file's name without the ending.
    pub name: String,
    /// Whether the targets can be told from one another: else there is rightly no pose.
    pub can_be_told: bool,
    /// How the box drives its lamps.
    pub lamps: LampMode,
    whole: Table,
}

impl Keeping {
    /// The scene of this name in `scenes/keeping`.
    pub fn named(name: &str) -> Self {
        let mut whole = parsed(&scenes().join("keeping.toml"));
        add(&mut whole, name);
        let expected = whole.remove("expect");
        let can_be_told = expected.is_none_or(|expected| expected.as_str() != Some("refused"));
        let lamps = match whole.remove("lamps").as_ref().and_then(Value::as_str) {
            Some("off") => LampMode::Off,
            Some("alternate") => LampMode::Alternate,
            _ => LampMode::On,
        };
        Self { name: name.to_owned(), can_be_told, lamps, whole }
    }

    /// Adds the text of a scene file to it.
    pub fn extend(&mut self, addition: &str) {
        merge(&mut self.whole, addition.parse().unwrap_or_else(|error| panic!("{error}")));
    }

    /// Takes all its motion out.
    pub fn still(&mut self) {
        self.whole.remove("motion");
    }

    /// All scenes of the folder, by name.
    pub fn all() -> Vec<Self> {
        let folder = std::fs::read_dir(scenes().join("keeping")).expect("the folder of scenes is there");
        let mut names: Vec<String> =
            folder.filter_map(|entry| Some(entry.ok()?.path().file_stem()?.to_str()?.to_owned())).collect();
        names.sort();
        names.iter().map(|name| Self::named(name)).collect()
    }

    /// The scene with this seed.
    pub fn scene(&self, seed: u64) -> Scene {
        scene(&self.whole, &self.name, seed)
    }
}

fn scene(text: &Table, name: &str, seed: u64) -> Scene {
    let scene = Scene::parse(&text.to_string(), &format!("{name}.toml"));
    scene.unwrap_or_else(|error| panic!("{error}")).with_seed(seed)
}

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn parsed(path: &Path) -> Table {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Adds the file `name`, after the files that it names in `with`, in the place of the tables that it names in
/// `replace`.
fn add(to: &mut Table, name: &str) {
    let mut addition = parsed(&scenes().join("keeping").join(format!("{name}.toml")));
    if let Some(Value::Array(names)) = addition.remove("with") {
        for name in names.iter().filter_map(Value::as_str) {
            add(to, name);
        }
    }
    if let Some(Value::Array(names)) = addition.remove("replace") {
        for name in names.iter().filter_map(Value::as_str) {
            to.remove(name);
        }
    }
    merge(to, addition);
}

/// Lists grow, tables are merged, everything else is replaced.
fn merge(to: &mut Table, from: Table) {
    for (key, value) in from {
        match (to.get_mut(&key), value) {
            (Some(Value::Table(to)), Value::Table(from)) => merge(to, from),
            (Some(Value::Array(to)), Value::Array(from)) if to.iter().all(Value::is_table) => to.extend(from),
            (_, value) => drop(to.insert(key, value)),
        }
    }
}
