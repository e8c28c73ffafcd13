//! Views of a picture: a cut at a place that may reach over the border. In: bytes `[height, width, channels]`, of one picture or of a stack side by side in its channels,
//! and a place. Out: the bytes of the view, cut at one place for all its channels.

/// What lies beyond a picture's border.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// Its outermost pixels, again and again.
    Repeated,
    /// Zeros.
    Black,
}

/// Appends the view of `size` that begins at `place` to `out`.
///
/// # Shapes
/// - `picture`: `[height, width, channels]`
///
/// # Panics
/// If `picture` does not hold that many bytes.
pub fn cut(
    picture: &[u8],
    [height, width, channels]: [usize; 3],
    [top, left]: [i32; 2],
    size: [usize; 2],
    border: Border,
    out: &mut Vec<u8>,
) {
    let inside = |at: i32, length: usize| (0..length as i32).contains(&at);
    for row in top..top + size[0] as i32 {
        if border == Border::Black && !inside(row, height) {
            out.resize(out.len() + size[1] * channels, 0);
            continue;
        }
        let line = &picture[row.clamp(0, height as i32 - 1) as usize * width * channels..][..width * channels];
        // Columns that lie in the picture are copied at once, those beyond it one by one.
        let (from, to) = (left.clamp(0, width as i32), (left + size[1] as i32).clamp(0, width as i32));
        let beyond = |column: usize, count: i32, out: &mut Vec<u8>| {
            for _ in 0..count {
                match border {
                    Border::Repeated => out.extend_from_slice(&line[column * channels..][..channels]),
                    Border::Black => out.resize(out.len() + channels, 0),
                }
            }
        };
        beyond(0, (from - left).min(size[1] as i32), out);
        out.extend_from_slice(&line[from as usize * channels..to.max(from) as usize * channels]);
        beyond(width - 1, (left + size[1] as i32 - to).min(size[1] as i32), out);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use serde_json::Value as Json;

    use super::*;

    fn bytes(json: &Json) -> Vec<u8> {
        json.as_array().unwrap().iter().map(|byte| byte.as_u64().unwrap() as u8).collect()
    }

    #[test]
    fn views_agree_with_padded_and_sliced_arrays() {
        let golden: Json = serde_json::from_str(include_str!("../../tests/golden/cut.json")).unwrap();
        let case = &golden;
        let shape: Vec<usize> = serde_json::from_value(case["in"]["shape"].clone()).unwrap();
        let size: [usize; 2] = serde_json::from_value(case["in"]["size"].clone()).unwrap();
        let picture = bytes(&case["in"]["picture"]);
        let views = case["out"]["views"].as_array().unwrap();
        assert!(views.len() > 20);
        for view in views {
            let place: [i32; 2] = serde_json::from_value(view["place"].clone()).unwrap();
            for (border, name) in [(Border::Repeated, "repeated"), (Border::Black, "black")] {
                let mut out = Vec::new();
                cut(&picture, [shape[0], shape[1], shape[2]], place, size, border, &mut out);
                assert_eq!(out, bytes(&view[name]), "{place:?} {name}");
            }
        }
    }
}
