//! Parquet files with the encodings that make room for as many values as they name, whole and damaged.

use std::path::Path;
use std::sync::Arc;

use ::arrow::array::{ArrayRef, Float32Array, RecordBatch, StringArray};
use ::parquet::arrow::ArrowWriter;
use ::parquet::basic::Encoding;
use ::parquet::file::properties::{WriterProperties, WriterVersion};

use crate::input::TableFile;

/// Texts that begin alike, every third missing.
fn texts() -> Vec<Option<String>> {
    (0..200).map(|row| (row % 3 != 0).then(|| format!("video-{}", row / 7))).collect()
}

/// The same texts in three encodings, and numbers.
fn write(path: &Path, version: WriterVersion) {
    let texts = || Arc::new(StringArray::from(texts())) as ArrayRef;
    let numbers = Arc::new(Float32Array::from_iter_values((0..200).map(|row| row as f32))) as ArrayRef;
    let columns = [("dictionary", texts()), ("lengths", texts()), ("prefixes", texts()), ("number", numbers)];
    let table = RecordBatch::try_from_iter(columns).expect("table");
    let mut properties = WriterProperties::builder().set_writer_version(version);
    for (name, encoding) in [("lengths", Encoding::DELTA_LENGTH_BYTE_ARRAY), ("prefixes", Encoding::DELTA_BYTE_ARRAY)] {
        properties = properties.set_column_dictionary_enabled(name.into(), false);
        properties = properties.set_column_encoding(name.into(), encoding);
    }
    let file = std::fs::File::create(path).expect("file");
    let mut writer = ArrowWriter::try_new(file, table.schema(), Some(properties.build())).expect("writer");
    writer.write(&table).expect("rows");
    writer.close().expect("footer");
}

const VERSIONS: [WriterVersion; 2] = [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0];

#[test]
fn texts_by_differences_and_by_dictionary_read_as_they_were_written() {
    let dir = tempfile::tempdir().expect("folder");
    for version in VERSIONS {
        let path = dir.path().join("table.parquet");
        write(&path, version);
        let names = ["dictionary", "lengths", "prefixes"].map(String::from);
        let frame = TableFile::open(&path).and_then(|file| file.read(&names)).unwrap_or_else(|e| panic!("{e}"));
        for name in names {
            let column = frame.column(&name).and_then(|column| column.str().cloned()).expect("texts");
            let found: Vec<Option<String>> = column.iter().map(|text| text.map(String::from)).collect();
            assert_eq!(found, texts(), "{name}");
        }
    }
}

/// Lengths that no file has would end the process, not the test.
#[test]
fn every_byte_may_be_damaged() {
    let dir = tempfile::tempdir().expect("folder");
    let (mut read, mut refused) = (0, 0);
    for version in VERSIONS {
        let path = dir.path().join("table.parquet");
        write(&path, version);
        let whole = std::fs::read(&path).expect("bytes");
        for at in 4..whole.len() {
            for damage in [0x7F, 0xFF] {
                let mut bytes = whole.clone();
                bytes[at] = damage;
                std::fs::write(&path, &bytes).expect("file");
                match TableFile::open(&path).and_then(|file| file.read(file.names())) {
                    Ok(_) => read += 1,
                    Err(error) => {
                        assert!(error.to_string().contains("table.parquet"), "{error}");
                        refused += 1;
                    }
                }
            }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} read, {refused} refused");
}

/// Numbers stored by differences begin with the lengths 128 and 4 of their blocks; how many they are follows.
#[test]
fn texts_without_number_are_refused() {
    let dir = tempfile::tempdir().expect("folder");
    for version in VERSIONS {
        let path = dir.path().join("table.parquet");
        write(&path, version);
        let whole = std::fs::read(&path).expect("bytes");
        let places = whole.windows(3).enumerate().filter(|(_, bytes)| *bytes == [0x80, 0x01, 0x04]);
        let places: Vec<usize> = places.map(|(at, _)| at + 3).collect();
        assert!(places.len() >= 3, "one by lengths, two by prefixes: {places:?}");
        for at in places {
            let mut bytes = whole.clone();
            bytes[at..at + 6].copy_from_slice(&[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F]);
            std::fs::write(&path, &bytes).expect("file");
            let fault = TableFile::open(&path).and_then(|file| file.read(file.names())).expect_err("2⁴² texts");
            assert!(fault.to_string().contains("more values than it has room for"), "{fault}");
        }
    }
}
