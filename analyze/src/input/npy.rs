//! Latents from NumPy: an `.npz` of arrays `episode`, `step`, `latent` (as `np.savez` writes it), a structured `.npy` with these fields,
//! or a plain `[rows, dims]` array with `episode.npy` and `step.npy` beside it.

use std::path::Path;

use vibes_data::Latents;

use super::InputError;

/// One array: its fields (a plain array has one, without a name), its shape and its bytes.
struct Array<'a> {
    fields: Vec<Field>,
    shape: Vec<usize>,
    /// Stored column by column: Fortran order.
    columns_first: bool,
    data: &'a [u8],
    path: &'a Path,
}

/// A field of an array's elements: byte offset within the element, kind (`f`, `u`, `i`), bytes a number, numbers.
struct Field {
    name: String,
    offset: usize,
    kind: char,
    bytes: usize,
    count: usize,
}

pub(super) fn read(path: &Path) -> Result<Latents, InputError> {
    let bytes = std::fs::read(path).map_err(InputError::io(path))?;
    if bytes.starts_with(b"PK") {
        let members = unzip(&bytes, path)?;
        return by_name(path, |name| {
            members.iter().find(|m| m.0 == format!("{name}.npy")).map(|m| parse(m.1, path)).transpose()
        });
    }
    let array = parse(&bytes, path)?;
    if array.fields.len() > 1 {
        return by_name(path, |name| array.field(name));
    }
    let beside = |name: &str| -> Result<Vec<u8>, InputError> {
        let file = path.with_file_name(format!("{name}.npy"));
        std::fs::read(&file).map_err(|_e| InputError::MissingColumn {
            missing: format!("{name} ({name}.npy beside the array)"),
            found: "latent".into(),
            path: path.into(),
        })
    };
    let (episode, step) = (beside("episode")?, beside("step")?);
    by_name(path, |name| match name {
        "episode" => parse(&episode, path).map(Some),
        "step" => parse(&step, path).map(Some),
        "latent" => parse(&bytes, path).map(Some),
        _ => Ok(None),
    })
}

fn wrong(path: &Path, column: &str, fact: impl Into<String>, expected: &str) -> InputError {
    InputError::Column { column: column.into(), fact: fact.into(), expected: expected.into(), path: path.into() }
}

fn broken(path: &Path, fact: &str) -> InputError {
    InputError::NotATable { fact: fact.into(), path: path.into() }
}

fn by_name<'a>(
    path: &Path,
    array: impl Fn(&str) -> Result<Option<Array<'a>>, InputError>,
) -> Result<Latents, InputError> {
    let needed = |name: &str| {
        let missing =
            || InputError::MissingColumn { missing: name.into(), found: "other arrays".into(), path: path.into() };
        array(name)?.ok_or_else(missing)
    };
    let (episode, step, latent) =
        (needed("episode")?.keys("episode")?, needed("step")?.keys("step")?, needed("latent")?);
    let rows = episode.len();
    let (latent_rows, dims) = latent.size();
    if step.len() != rows || latent_rows != rows {
        let fact = format!("{rows} episodes, {} steps and {latent_rows} latents", step.len());
        return Err(wrong(path, "episode, step and latent", fact, "arrays of one length"));
    }
    let cells = |name: &str| -> Result<Vec<Option<u32>>, InputError> {
        let Some(array) = array(name)? else { return Ok(vec![None; rows]) };
        let keys = array.keys(name)?;
        let fault = || wrong(path, name, format!("{} values", keys.len()), "one a row");
        if keys.len() == rows { Ok(keys.into_iter().map(Some).collect()) } else { Err(fault()) }
    };
    let (state, distractor) = (cells("state")?, cells("distractor")?);
    let reward = match array("reward")? {
        Some(rewards) if rewards.size().0 == rows => {
            rewards.numbers().into_iter().map(|v| Some(v as f32).filter(|v| v.is_finite())).collect()
        }
        _ => vec![None; rows],
    };
    let values = latent.numbers().into_iter().map(|v| v as f32).collect();
    Ok(Latents { episode, step, state, distractor, reward, dims, latent: values, ..Latents::default() })
}

impl<'a> Array<'a> {
    /// Rows, and numbers a row.
    fn size(&self) -> (usize, usize) {
        let rows = self.shape.first().copied().unwrap_or(1);
        (rows, self.fields[0].count * self.shape.iter().skip(1).product::<usize>())
    }

    /// One field as an array of its own.
    fn field(&self, name: &str) -> Result<Option<Self>, InputError> {
        let Some(field) = self.fields.iter().find(|f| f.name == name) else { return Ok(None) };
        let whole = self.fields.iter().map(|f| f.bytes * f.count).sum();
        let skip = Field { name: String::new(), offset: 0, kind: 'V', bytes: 1, count: whole };
        let field = Field { name: field.name.clone(), ..*field };
        let fields = vec![field, skip];
        Ok(Some(Self { fields, shape: self.shape.clone(), columns_first: false, data: self.data, path: self.path }))
    }

    /// All numbers, `[rows, count]`, as float64: exact for float32 and for integers below 2^53.
    fn numbers(&self) -> Vec<f64> {
        let field = &self.fields[0];
        // A field cut out of a structure is followed by one that says how long the whole element is.
        let element = self.fields.last().filter(|f| f.kind == 'V').map_or(field.bytes * field.count, |f| f.count);
        let number = |b: &[u8]| match (field.kind, b) {
            ('f', &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
            ('f', &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            ('u', _) => b.iter().rev().fold(0u64, |v, &x| v << 8 | u64::from(x)) as f64,
            _ => {
                let fill = if b.last().is_some_and(|x| x & 0x80 != 0) { -1i64 } else { 0 };
                b.iter().rev().fold(fill, |v, &x| v << 8 | i64::from(x)) as f64
            }
        };
        let part = |element: &'a [u8]| {
            element[field.offset..field.offset + field.bytes * field.count].chunks_exact(field.bytes)
        };
        let numbers: Vec<f64> = self.data.chunks_exact(element).flat_map(part).map(number).collect();
        if !self.columns_first {
            return numbers;
        }
        let (rows, columns) = self.size();
        (0..rows).flat_map(|row| (0..columns).map(move |column| column * rows + row)).map(|at| numbers[at]).collect()
    }

    fn keys(&self, name: &str) -> Result<Vec<u32>, InputError> {
        let expected = "an integer from 0 to 4294967295 in every row";
        if self.fields[0].kind == 'f' || self.size().1 != 1 {
            return Err(wrong(self.path, name, "floats, or several numbers a row", expected));
        }
        let key = |v: f64| {
            if (0.0..=f64::from(u32::MAX)).contains(&v) {
                Ok(v as u32)
            } else {
                Err(wrong(self.path, name, format!("it holds {v}"), expected))
            }
        };
        self.numbers().into_iter().map(key).collect()
    }
}

/// Reads the header of an npy file: magic, version, length, then a Python dictionary.
fn parse<'a>(bytes: &'a [u8], path: &'a Path) -> Result<Array<'a>, InputError> {
    let fault = |fact: &str| broken(path, fact);
    if !bytes.starts_with(b"\x93NUMPY") || bytes.len() < 12 {
        return Err(fault("a damaged npy file"));
    }
    let (length, start): (usize, usize) = match bytes[6] {
        1 => (usize::from(u16::from_le_bytes([bytes[8], bytes[9]])), 10),
        _ => (u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize, 12),
    };
    let header = bytes.get(start..start.saturating_add(length)).ok_or_else(|| fault("a truncated npy file"))?;
    let header = std::str::from_utf8(header).map_err(|_e| fault("an npy file with a damaged header"))?;
    let data = &bytes[start + length..];
    let shape_text = after(header, "'shape':")
        .and_then(|t| between(t, '(', ')'))
        .ok_or_else(|| fault("an npy file without a shape"))?;
    let shape: Vec<usize> = shape_text.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let fields = fields(header)
        .ok_or_else(|| fault("an npy file of numbers that are not little-endian float32, float64 or integers"))?;
    let element: usize = fields.iter().map(|f| f.bytes * f.count).sum();
    let expected = shape.iter().try_fold(element, |a, &b| a.checked_mul(b));
    if expected != Some(data.len()) || element == 0 {
        return Err(fault("an npy file of another length than its header says"));
    }
    let columns_first = header.contains("'fortran_order': True") && shape.len() > 1;
    if columns_first && (shape.len() > 2 || fields.len() > 1) {
        return Err(fault("an array of more than two dimensions in Fortran order (save np.ascontiguousarray(latent))"));
    }
    Ok(Array { fields, shape, columns_first, data, path })
}

fn after<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    text.find(key).map(|i| text[i + key.len()..].trim_start())
}

fn between(text: &str, open: char, close: char) -> Option<&str> {
    let from = text.find(open)? + open.len_utf8();
    let to = from + text[from..].find(close)?;
    Some(&text[from..to])
}

/// The fields of `'descr'`: `'<f4'`, or `[('episode', '<u4'), ('latent', '<f4', (32,))]`.
fn fields(header: &str) -> Option<Vec<Field>> {
    let descr = after(header, "'descr':")?;
    if descr.starts_with('\'') {
        return Some(vec![field("", between(descr, '\'', '\'')?, 1, 0)?]);
    }
    let list = &descr[1..descr.find(']')?];
    let mut fields: Vec<Field> = Vec::new();
    for part in list.split("('").skip(1) {
        let mut words = part.split('\'');
        let (name, kind) = (words.next()?, words.nth(1)?);
        let count = words.next().and_then(|rest| between(rest, '(', ')')).map_or(Some(1), |dims| {
            dims.split(',')
                .filter(|n| !n.trim().is_empty())
                .try_fold(1usize, |a, n| a.checked_mul(n.trim().parse().ok()?))
        })?;
        let offset = fields.last().map_or(0, |f| f.offset + f.bytes * f.count);
        fields.push(field(name, kind, count, offset)?);
    }
    (!fields.is_empty()).then_some(fields)
}

fn field(name: &str, descr: &str, count: usize, offset: usize) -> Option<Field> {
    let mut letters = descr.chars();
    let (order, kind) = (letters.next()?, letters.next()?);
    let bytes: usize = letters.as_str().parse().ok()?;
    let known = matches!((kind, bytes), ('f', 4 | 8) | ('u' | 'i', 1 | 2 | 4 | 8));
    (known && (order == '<' || bytes == 1)).then(|| Field { name: name.into(), offset, kind, bytes, count })
}

/// The stored members of a zip file, by its central directory.
fn unzip<'a>(bytes: &'a [u8], path: &Path) -> Result<Vec<(String, &'a [u8])>, InputError> {
    members(bytes).ok_or_else(|| {
        broken(path, "a damaged or compressed npz file (write it with np.savez, not np.savez_compressed)")
    })
}

fn members(bytes: &[u8]) -> Option<Vec<(String, &[u8])>> {
    let int = |at: usize, n: usize| {
        Some(bytes.get(at..at.checked_add(n)?)?.iter().rev().fold(0usize, |v, &b| v << 8 | usize::from(b)))
    };
    let end =
        (0..bytes.len().saturating_sub(21)).rev().take(66_000).find(|&i| bytes[i..].starts_with(b"PK\x05\x06"))?;
    let (count, mut at) = (int(end + 10, 2)?, int(end + 16, 4)?);
    let mut found = Vec::new();
    for _ in 0..count {
        if !bytes.get(at..)?.starts_with(b"PK\x01\x02") || int(at + 10, 2)? != 0 {
            return None;
        }
        let (name, extra, comment) = (int(at + 28, 2)?, int(at + 30, 2)?, int(at + 32, 2)?);
        let (size, header) = (int(at + 24, 4)?, int(at + 42, 4)?);
        let size = if size == 0xFFFF_FFFF { int(at + 46 + name + 4, 8)? } else { size };
        let text = String::from_utf8(bytes.get(at + 46..at + 46 + name)?.to_vec()).ok()?;
        let data =
            header.checked_add(30)?.checked_add(int(header.checked_add(26)?, 2)? + int(header.checked_add(28)?, 2)?)?;
        found.push((text, bytes.get(data..data.checked_add(size)?)?));
        at = at.checked_add(46 + name + extra + comment)?;
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_of_an_array_read_the_same() {
        let npy = |fortran: &str, values: [f32; 6]| {
            let header = format!("{{'descr': '<f4', 'fortran_order': {fortran}, 'shape': (2, 3), }}\n");
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.bytes());
            bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
            bytes
        };
        let rows = npy("False", [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let columns = npy("True", [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
        for bytes in [rows, columns] {
            let array = parse(&bytes, Path::new("x.npy")).expect("array");
            assert_eq!((array.size(), array.numbers()), ((2, 3), vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        }
    }
}
