//! The readers of `vibes-analyze`: tables of latents as users have them, maps and neighbour graphs, and run folders as the figures see them.

use std::fs;
use std::path::Path;

use vibes_analyze::input::{Run, TableFile, read_latents};
use vibes_analyze::output::{Column, GraphTable, MapTable, write_csv, write_parquet, write_table};
use vibes_measure::neighbours::Neighbours;

use crate::readers::{Part, Reader};

/// All of them.
pub(crate) const PART: Part = Part { readers: &READERS, make };

const READERS: [Reader; 11] = [
    Reader { name: "table_csv", file: "table.csv", read: table },
    Reader { name: "table_parquet", file: "table.parquet", read: table },
    Reader { name: "table_arrow", file: "table.arrow", read: table },
    Reader { name: "table_stream", file: "table.arrows", read: table },
    Reader { name: "table_npy", file: "table.npy", read: table },
    Reader { name: "table_npz", file: "table.npz", read: table },
    Reader { name: "map", file: "map.arrow", read: |_, path| MapTable::read(path).is_some() },
    Reader { name: "graph", file: "graph.arrow", read: |_, path| GraphTable::read(path).is_some() },
    Reader { name: "run_info", file: "run/run.json", read: run },
    Reader { name: "run_metrics", file: "run/metrics.jsonl", read: run },
    Reader { name: "run_evaluation", file: "run/evaluation.json", read: run },
];

/// Makes the valid files.
fn make(folder: &Path) {
    let at = |name: &str| folder.join(name);
    let numbers = |first: f32| Column::Float32((0..4).map(|row| first + 0.25 * row as f32).collect());
    let columns = [
        ("episode", Column::UInt32(vec![0, 0, 1, 1])),
        ("step", Column::UInt32(vec![0, 1, 0, 1])),
        ("latent_0", numbers(0.5)),
        ("latent_1", numbers(-1.0)),
        ("speed", Column::Float64(vec![0.1, f64::NAN, 2e-3, 4.0])),
        ("kind", Column::Text(["still", "moving", "still", ""].map(String::from).to_vec())),
    ];
    write_csv(&at("table.csv"), &columns).unwrap();
    write_parquet(&at("table.parquet"), &columns).unwrap();
    write_table(&at("table.arrow"), &columns, &[("vibes.recording", "recordings/a".into())]).unwrap();
    fs::write(at("table.arrows"), stream(&at("table.arrow"))).unwrap();
    fs::write(at("table.npy"), structured()).unwrap();
    write_npz(&at("table.npz"));
    let (recipe, quality, latents) = ("umap".into(), "{}".into(), "latents.arrow".into());
    let positions = vec![[1.5, -2.0], [0.0, 0.25]];
    MapTable { episode: vec![0, 0], step: vec![0, 1], positions, recipe, quality, latents }
        .write(&at("map.arrow"))
        .unwrap();
    let neighbours = Neighbours::from_parts(2, vec![1, 2, 0, 2, 0, 1], vec![0.5, 1.0, 0.5, 2.0, 0.1, 0.2]).unwrap();
    GraphTable { recipe: "latents".into(), neighbours }.write(&at("graph.arrow")).unwrap();
    make_run(&at("run"));
}

/// The same table as an Arrow stream.
fn stream(file: &Path) -> Vec<u8> {
    let batches = vibes_data::read_table(file).unwrap();
    let mut writer = arrow::ipc::writer::StreamWriter::try_new(Vec::new(), &batches[0].schema()).unwrap();
    batches.iter().for_each(|batch| writer.write(batch).unwrap());
    writer.finish().unwrap();
    writer.into_inner().unwrap()
}

/// An array as `np.save` writes it.
fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': ({shape}), }}");
    header.push_str(&" ".repeat(63 - (10 + header.len()) % 64));
    header.push('\n');
    [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
}

/// Rows of a structure: key and latent.
fn structured() -> Vec<u8> {
    let row = |step: u32| [0_u32, step, 0x3F80_0000, 0x4000_0000].map(u32::to_le_bytes).concat();
    npy("[('episode', '<u4'), ('step', '<u4'), ('latent', '<f4', (2,))]", "3,", &[row(0), row(1), row(2)].concat())
}

/// The same as an archive of arrays.
fn write_npz(path: &Path) {
    use std::io::Write;
    let mut writer = zip::ZipWriter::new(fs::File::create(path).unwrap());
    let keys = |of: [u32; 3]| of.map(u32::to_le_bytes).concat();
    let arrays = [
        ("episode", npy("'<u4'", "3,", &keys([0; 3]))),
        ("step", npy("'<u4'", "3,", &keys([0, 1, 2]))),
        ("latent", npy("'<f2'", "3, 2", &[0; 12])),
    ];
    for (name, bytes) in arrays {
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(&bytes).unwrap();
    }
    writer.finish().unwrap();
}

/// A run with all that the figures read of it.
fn make_run(folder: &Path) {
    fs::create_dir(folder).unwrap();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write(
        "run.json",
        r#"{"format":"vibes-run/1","options":{"objective":"vibes"},"model":{"task":"reacher-easy"},"recordings":["../a"],"episodes":2,"steps":250,"versions":{}}"#,
    );
    write("metrics.jsonl", "{\"update\":10,\"loss\":2.5,\"gap\":null}\n{\"update\":20,\"loss\":1.5,\"gap\":0.5}\n");
    write(
        "evaluation.json",
        r#"{"checkpoint":"checkpoints/000020/model.safetensors","report":{"numbers":{"state_share":{"estimate":0.5,"interval":[0.4,0.6]}}},"gaps":{"dynamics_gap":1.5}}"#,
    );
}

/// A table: every column of it by itself, and the latents.
fn table(_: &Path, path: &Path) -> bool {
    if let Ok(file) = TableFile::open(path) {
        for name in file.names() {
            let _ = file.read(std::slice::from_ref(name));
        }
    }
    read_latents(path).is_ok()
}

/// The run in whose folder the file lies.
fn run(_: &Path, path: &Path) -> bool {
    Run::read(path.parent().unwrap()).is_ok_and(|run| run.broken_lines == 0 && run.final_value("state_share").is_some())
}
