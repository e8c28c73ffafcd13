//! Episodes as an earlier version wrote them, for tests of `data` and of `collect`. In: a recording's folder. Out: the same recording with an older table in it.

use std::fs;
use std::path::Path;

use arrow::ipc::writer::FileWriter;
use vibes_data::{FileEntry, Manifest, read_table};

/// Writes the table of an episode once more as it was before there was the column of what a policy saw; the manifest lists it so.
pub(crate) fn make_older(folder: &Path, place: usize) {
    let listed = folder.join("manifest.json");
    let mut manifest = Manifest::read(&listed).unwrap();
    let name = manifest.episodes[place].arrow.path.clone();
    let path = folder.join(&name);
    let batch = read_table(&path).unwrap().remove(0);
    let kept: Vec<usize> =
        (0..batch.num_columns()).filter(|&at| batch.schema().field(at).name() != "acting_distractor").collect();
    assert_eq!(kept.len() + 1, batch.num_columns(), "it had the column");
    let older = batch.project(&kept).unwrap();
    let mut writer = FileWriter::try_new(Vec::new(), &older.schema()).unwrap();
    writer.write(&older).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().unwrap();
    fs::write(&path, &bytes).unwrap();
    manifest.episodes[place].arrow = FileEntry::of(name, &bytes);
    manifest.write(&listed).unwrap();
}
