//! Laws of reading: the same table from whatever wrote it, and a clear word about what cannot be read.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use vibes_data::Latents;

use super::*;

const ROWS: usize = 24;
const DIMS: usize = 4;

/// What writes files of a name and a text into a folder.
pub(super) fn writer(folder: &Path) -> impl Fn(&str, &str) {
    let folder = folder.to_owned();
    move |name, text| std::fs::write(folder.join(name), text).expect("file")
}

fn tables() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/tables");
    let mut all: Vec<PathBuf> = std::fs::read_dir(folder).expect("folder").flatten().map(|f| f.path()).collect();
    all.sort();
    assert!(all.len() >= 22, "{all:?}");
    all
}

/// The table of `tests/golden/make_tables.py`.
fn wanted() -> Latents {
    let number = |row: usize, dim: usize| (((row * 37 + dim * 11) % 101) as f32 - 50.0) / 64.0;
    Latents {
        episode: (0..ROWS as u32).map(|row| row / 12).collect(),
        step: (0..ROWS as u32).map(|row| row % 12).collect(),
        state: (0..ROWS as u32).map(|row| Some(row / 12 % 2)).collect(),
        distractor: vec![Some(0); ROWS],
        reward: (0..ROWS).map(|row| (row % 12 != 11).then_some((row % 5) as f32 / 4.0)).collect(),
        dims: DIMS,
        latent: (0..ROWS * DIMS).map(|i| number(i / DIMS, i % DIMS)).collect(),
        ..Latents::default()
    }
}

#[test]
fn every_table_of_others_reads_the_same() {
    for path in tables() {
        let read = read_asked(&path, &Asked::default()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(read.latents, wanted(), "{}", path.display());
        assert!(read.remarks.is_empty(), "{:?}", read.remarks);
    }
}

#[test]
fn a_users_own_column_comes_along_wherever_it_lies() {
    for path in tables() {
        let file = TableFile::open(&path).expect("table");
        let texts = file.has("video") && path.extension().is_some_and(|e| e != "npy");
        if !texts {
            continue;
        }
        let asked = Asked { columns: vec!["video".into()], ..Asked::default() };
        let read = read_asked(&path, &asked).unwrap_or_else(|e| panic!("{e}"));
        let UserColumn::Kinds { of_row, names } = &read.columns[0].1 else { panic!("{}", path.display()) };
        assert_eq!(names, &["bus", "dogs", "surf"], "{}", path.display());
        assert_eq!(of_row[..4], [Some(1), Some(2), Some(1), Some(0)], "{}", path.display());
    }
}

#[test]
fn rows_are_chosen_by_their_own_and_by_joined_columns() {
    let dir = tempfile::tempdir().expect("folder");
    let table = tables().into_iter().find(|p| p.ends_with("polars-zstd.arrow")).expect("table");
    let join = dir.path().join("notes.csv");
    let lines = (0..ROWS).filter(|row| row % 3 != 0).map(|row| format!("{},{},{}\n", row / 12, row % 12, row * row));
    std::fs::write(&join, format!("episode,step,square\n{}", lines.collect::<String>())).expect("file");
    let asked = Asked {
        rows: Some("square >= 25 and video = 'surf' and step < 11".parse().expect("expression")),
        joins: vec![join.clone()],
        columns: vec!["square".into()],
        ..Asked::default()
    };
    let read = read_asked(&table, &asked).unwrap_or_else(|e| panic!("{e}"));
    let want: Vec<usize> = (0..ROWS).filter(|r| r % 3 != 0 && r * r >= 25 && r % 4 == 1 && r % 12 < 11).collect();
    assert!(want.len() >= 3);
    let all = wanted();
    assert_eq!(read.latents.step, want.iter().map(|&row| (row % 12) as u32).collect::<Vec<_>>());
    assert_eq!(read.latents.latent, want.iter().flat_map(|&row| all.row(row).to_vec()).collect::<Vec<_>>());
    assert_eq!(read.columns[0].1, UserColumn::Numbers(want.iter().map(|&row| (row * row) as f64).collect()));
    assert!(read.remarks.iter().any(|r| r.contains("8 of 24 rows have no row in")), "{:?}", read.remarks);
    // By episode alone, and twice the same row.
    std::fs::write(&join, "episode;weather\n0;sun\n1;rain\n").expect("file");
    let asked = Asked { joins: vec![join.clone()], columns: vec!["weather".into()], ..Asked::default() };
    let read = read_asked(&table, &asked).unwrap_or_else(|e| panic!("{e}"));
    let UserColumn::Kinds { of_row, .. } = &read.columns[0].1 else { panic!("kinds") };
    assert_eq!((of_row[0], of_row[23]), (Some(1), Some(0)));
    std::fs::write(&join, "episode,weather\n0,sun\n0,rain\n").expect("file");
    let fault = read_asked(&table, &asked).expect_err("twice").to_string();
    assert!(fault.contains("a row occurs twice"), "{fault}");
}

/// The mark of a stream's end may be missing, as where its writer was killed after a whole batch.
#[test]
fn a_stream_that_just_ends_has_ended() {
    let dir = tempfile::tempdir().expect("folder");
    let mut streams = 0;
    for path in tables() {
        let bytes = std::fs::read(&path).expect("bytes");
        let Some(unmarked) = bytes.strip_suffix(&[0xFF, 0xFF, 0xFF, 0xFF, 0, 0, 0, 0]) else { continue };
        if !bytes.starts_with(&[0xFF; 4]) {
            continue;
        }
        let cut = dir.path().join(path.file_name().expect("name"));
        std::fs::write(&cut, unmarked).expect("file");
        let [whole, found] = [&path, &cut].map(|path| read_latents(path).unwrap_or_else(|e| panic!("{e}")));
        assert_eq!(found.latent, whole.latent, "{}", cut.display());
        streams += 1;
    }
    assert!(streams > 0);
}

#[test]
fn a_column_whose_first_value_is_a_whole_number_may_hold_fractions() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("latents.csv");
    std::fs::write(&path, "episode,step,latent_0,height\n0,0,0,1\n0,1,0.25,2.5\n0,2,1,3\n").expect("file");
    let asked = Asked { columns: vec!["height".into()], ..Asked::default() };
    let read = read_asked(&path, &asked).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(read.latents.latent, [0.0, 0.25, 1.0]);
    assert_eq!(read.columns[0].1, UserColumn::Numbers(vec![1.0, 2.5, 3.0]));
}

/// Each by itself would lose its own mean, and the distance between the two with it.
#[test]
fn tables_that_are_measured_against_each_other_have_one_origin() {
    let dir = tempfile::tempdir().expect("folder");
    let write = |name: &str, from: f64| {
        let line = |row: u32| {
            let x = from + 1e-7 * f64::from(row * 37 % 41);
            format!("0,{row},{x},{}\n", -x)
        };
        let path = dir.path().join(name);
        let lines: String = (0..40).map(line).collect();
        std::fs::write(&path, format!("episode,step,latent_0,latent_1\n{lines}")).expect("CSV");
        path
    };
    let (one, other) = (write("one.csv", 1000.0), write("other.csv", 1_000.000_005));
    let (read, origin) = read_with_origin(&one, &Asked::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(origin != Origin::default() && read.remarks.len() == 1, "{:?}", read.remarks);
    let beside = read_beside(&other, &Asked::default(), &origin).unwrap_or_else(|e| panic!("{e}"));
    for (a, b) in read.latents.latent.chunks(2).zip(beside.latents.latent.chunks(2)) {
        let apart = [b[0] - a[0], a[1] - b[1]];
        assert!(apart.iter().all(|by| (by - 5e-6).abs() < 1e-9), "{apart:?}");
    }
    assert_eq!(beside.remarks.last().map(String::as_str), Some(MOVED));
    // Beside latents that nothing was taken away from, they lie where they lay.
    let plain = read_beside(&other, &Asked::default(), &Origin::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(plain.latents.latent.iter().all(|x| (x.abs() - 1000.0).abs() < 0.001));
    let again = read_beside(&one, &Asked::default(), &origin).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((again.latents, again.remarks), (read.latents, read.remarks));
}

#[test]
fn a_dimension_of_the_latents_is_a_column_like_any_other() {
    let wanted: Vec<f64> = wanted().latent.chunks(DIMS).map(|row| f64::from(row[1])).collect();
    let mut wide = 0;
    for path in tables() {
        let name = "latent_1".to_string();
        if TableFile::open(&path).is_ok_and(|file| file.has(&name)) {
            let asked = Asked { columns: vec![name.clone()], ..Asked::default() };
            let read = read_asked(&path, &asked).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(read.columns, [(name, UserColumn::Numbers(wanted.clone()))], "{}", path.display());
            wide += 1;
        }
    }
    assert!(wide > 1, "{wide}");
}

#[test]
fn what_is_used_and_of_a_wrong_type_is_named_and_what_is_unused_is_not() {
    let path = |name: &str| tables().into_iter().find(|p| p.ends_with(name)).expect("table");
    let ask = |file: &str, column: &str| {
        let asked = Asked { columns: vec![column.into()], ..Asked::default() };
        read_asked(&path(file), &asked).expect_err(column).to_string()
    };
    for (file, column, says) in [
        ("polars-zstd.arrow", "unused", "Int128"),
        ("half-lz4.arrow", "when", "Timestamp"),
        ("half-zstd.parquet", "unused", "Decimal"),
        ("structured.npy", "video", "S4"),
    ] {
        let fault = ask(file, column);
        assert!(fault.contains(&format!("column {column}")) && fault.contains(says), "{fault}");
    }
    let fault = ask("pandas-wide.csv", "weather");
    assert!(fault.contains("no table has a column weather, choose among"), "{fault}");
}

/// Bytes in a gzip file that stores them as they are.
fn gzip(bytes: &[u8]) -> Vec<u8> {
    let bit = |crc: u32, _: u32| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    let crc = !bytes.iter().fold(!0u32, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), bit));
    let length = bytes.len() as u32;
    let (header, [low, high, ..]) = ([0x1F, 0x8B, 8, 0, 0, 0, 0, 0, 0, 0xFF], length.to_le_bytes());
    [&header[..], &[1, low, high, !low, !high], bytes, &crc.to_le_bytes(), &length.to_le_bytes()].concat()
}

/// Bytes in a zstd file that stores them as they are; from 256 on.
fn zstd(bytes: &[u8]) -> Vec<u8> {
    let (length, block) = (bytes.len() as u16 - 256, ((bytes.len() as u32) << 3) | 1);
    [&[0x28, 0xB5, 0x2F, 0xFD, 0x60][..], &length.to_le_bytes(), &block.to_le_bytes()[..3], bytes].concat()
}

#[test]
fn a_csv_file_may_be_separated_and_packed_in_any_of_the_ways() {
    let dir = tempfile::tempdir().expect("folder");
    let commas = tables().into_iter().find(|path| path.ends_with("pandas-wide.csv")).expect("table");
    let commas = std::fs::read(commas).expect("bytes");
    for separator in [b',', b';', b'\t'] {
        let plain: Vec<u8> = commas.iter().map(|&byte| if byte == b',' { separator } else { byte }).collect();
        for (ending, bytes) in [("csv", plain.clone()), ("csv.gz", gzip(&plain)), ("csv.zst", zstd(&plain))] {
            let path = dir.path().join(format!("latents-{separator}.{ending}"));
            std::fs::write(&path, bytes).expect("file");
            assert_eq!(read_latents(&path).unwrap_or_else(|e| panic!("{e}")), wanted(), "{}", path.display());
        }
    }
}

/// What Python's csv and pandas write for numbers that are missing.
#[test]
fn empty_and_nan_cells_of_a_csv_are_numbers_that_are_missing() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("latents.csv");
    let rows = "0,0,,,,0.5,1\n0,1,,,nan,0.25,2\n1,0,,,-2.5,0.125,3\n";
    std::fs::write(&path, format!("episode,step,state,distractor,reward,latent_0,latent_1\n{rows}")).expect("CSV");
    let read = read_latents(&path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((read.state, read.reward.len()), (vec![None; 3], 3));
    assert!(read.reward[..2].iter().all(|reward| reward.is_none_or(f32::is_nan)) && read.reward[2] == Some(-2.5));
}

/// Without rows a column has no type, which is no fault of the column.
#[test]
fn a_table_without_rows_says_so() {
    let dir = tempfile::tempdir().expect("folder");
    for columns in ["episode,step,latent", "episode,step,latent_0,latent_1"] {
        let path = dir.path().join("latents.csv");
        std::fs::write(&path, format!("{columns}\n")).expect("CSV");
        let fault = read_latents(&path).expect_err("no rows").to_string();
        assert!(fault.contains("the table has no rows") && fault.contains("latents.csv"), "{fault}");
    }
}

#[test]
fn a_column_that_is_a_row_short_is_an_error_in_every_format() {
    let dir = tempfile::tempdir().expect("folder");
    let npz = dir.path().join("short.npz");
    let array = |kind: &str, shape: &str, bytes: &[u8]| {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut all = b"\x93NUMPY\x01\x00".to_vec();
        all.extend((header.len() as u16).to_le_bytes());
        all.extend(header.bytes());
        all.extend(bytes);
        all
    };
    let mut writer = zip::ZipWriter::new(std::fs::File::create(&npz).expect("file"));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let members: [(&str, Vec<u8>); 4] = [
        ("episode", array("|u1", "(3,)", &[0; 3])),
        ("step", array("|u1", "(3,)", &[0, 1, 2])),
        ("latent", array("<f4", "(3, 2)", &[1; 24])),
        ("reward", array("<f4", "(2,)", &[0; 8])),
    ];
    for (name, bytes) in &members {
        writer.start_file(format!("{name}.npy"), options).expect("member");
        std::io::Write::write_all(&mut writer, bytes).expect("bytes");
    }
    writer.finish().expect("zip");
    let fault = read_latents(&npz).expect_err("a reward is missing").to_string();
    assert!(fault.contains("2 of reward") && fault.contains("3 of latent"), "{fault}");
}

/// What no parser can be asked to read: it would fill the stack, or ask for 4 GB.
#[test]
fn headers_of_arrays_without_measure_are_refused() {
    let dir = tempfile::tempdir().expect("folder");
    let array = |length: u32, header: &str| {
        [&b"\x93NUMPY\x02\x00"[..], &length.to_le_bytes(), header.as_bytes(), &[0; 64]].concat()
    };
    let deep = format!("{{'descr': {}, 'fortran_order': False, 'shape': (4,), }}\n", "[".repeat(60_000));
    let huge = "{'descr': '<f4', 'fortran_order': False, 'shape': (4,), }\n";
    for (bytes, says) in [
        (array(deep.len() as u32, &deep), "brackets in each other"),
        (array(u32::MAX, huge), "an npy header of 4294967295 bytes"),
    ] {
        let plain = dir.path().join("latents.npy");
        std::fs::write(&plain, &bytes).expect("file");
        let packed = dir.path().join("latents.npz");
        let mut writer = zip::ZipWriter::new(std::fs::File::create(&packed).expect("file"));
        for name in ["episode", "step", "latent"] {
            writer.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).expect("member");
            std::io::Write::write_all(&mut writer, &bytes).expect("bytes");
        }
        writer.finish().expect("zip");
        for path in [plain, packed] {
            let fault = read_latents(&path).expect_err(says).to_string();
            assert!(fault.contains(says) && fault.contains("latents.np"), "{fault}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Whatever is cut off or changed, the reader answers: with the table, or with an error that names the file.
    #[test]
    fn a_damaged_table_is_an_answer_not_a_panic(file in 0usize..22, at in 0.0f64..1.0, byte in any::<u8>(), cut in any::<bool>()) {
        let path = &tables()[file];
        let mut bytes = std::fs::read(path).expect("bytes");
        let at = ((bytes.len() - 1) as f64 * at) as usize;
        if cut { bytes.truncate(at) } else { bytes[at] = byte }
        let dir = tempfile::tempdir().expect("folder");
        let damaged = dir.path().join(path.file_name().expect("name"));
        std::fs::write(&damaged, bytes).expect("file");
        if let Err(error) = read_latents(&damaged) {
            let file = damaged.file_name().expect("name").to_string_lossy().into_owned();
            prop_assert!(error.to_string().contains(&file), "{error}");
        }
    }
}
