//! A headless Chromium that opens a page, clicks, drags, types and reads, over Chromium's own debugging pipe: no driver and no network.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

use base64::Engine as _;
use serde_json::{Value, json};

/// Programs that are Chromium, by what distributions call them, in the order of setup/browser.sh. Google's comes first: beside it Ubuntu's may be a snap, which does not
/// see the folders of the tests.
const PROGRAMS: [&str; 3] = ["google-chrome", "chromium", "chromium-browser"];

/// The program that `CHROMIUM=` names, or the first that runs and is no snap: the same check as in setup/browser.sh.
fn program() -> OsString {
    let programs = match std::env::var_os("CHROMIUM").filter(|named| !named.is_empty()) {
        Some(named) => vec![named],
        None => PROGRAMS.map(OsString::from).into_iter().filter(|program| !is_snap(program)).collect(),
    };
    let runs = |program: &OsString| {
        Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
    };
    let found = programs.iter().find(|program| runs(program)).cloned();
    found.unwrap_or_else(|| {
        panic!("a Chromium that is no snap is needed for this test, and none of {PROGRAMS:?} or CHROMIUM= is one that runs; see setup/browser.sh")
    })
}

/// Whether a program is a snap, or a script that runs one, as Ubuntu's package is.
fn is_snap(program: &OsStr) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders).map(|folder| folder.join(program)).find(|path| path.is_file());
    let Some(path) = found.and_then(|path| path.canonicalize().ok()) else { return false };
    let runs_snap = || std::fs::read_to_string(&path).is_ok_and(|script| script.contains("/snap/bin"));
    path.starts_with("/snap") || path.ends_with("snap") || runs_snap()
}

#[test]
fn a_script_that_runs_a_snap_is_not_taken_for_a_browser() {
    let folder = tempfile::tempdir().expect("folder");
    let program = folder.path().join("chromium-browser");
    for (script, snap) in [("#!/bin/sh\nexec /snap/bin/chromium \"$@\"\n", true), ("#!/bin/sh\nexec chrome\n", false)] {
        std::fs::write(&program, script).expect("script");
        assert_eq!(is_snap(program.as_os_str()), snap, "{script}");
    }
    assert!(!is_snap(OsStr::new("a-program-that-is-not-there")));
}

/// An open page.
pub(crate) struct Browser {
    child: Child,
    into: File,
    from: BufReader<File>,
    session: String,
    count: u64,
    _folder: tempfile::TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Browser {
    /// Opens a page in a window of this size; a phone's window is touched and scaled like one.
    pub(crate) fn open(page: &Path, (width, height): (u32, u32), phone: bool) -> Self {
        let folder = tempfile::tempdir().expect("folder");
        let fifo = |name: &str| -> PathBuf {
            let path = folder.path().join(name);
            assert!(Command::new("mkfifo").arg(&path).status().expect("mkfifo").success());
            path
        };
        let (commands, answers) = (fifo("commands"), fifo("answers"));
        let child = Command::new("sh")
            .arg("-c")
            .arg(format!(
                "exec \"$3\" --headless --no-sandbox --disable-gpu --hide-scrollbars --no-first-run --disable-background-networking \
                 --disable-component-update --disable-sync --user-data-dir=\"$2\" --window-size={width},{height} \
                 --remote-debugging-pipe 3<\"$0\" 4>\"$1\" 2>/dev/null"
            ))
            .args([&commands, &answers, &folder.path().join("profile")])
            .arg(program())
            .spawn()
            .expect("the browser starts");
        let into = File::options().write(true).open(&commands).expect("pipe");
        let from = BufReader::new(File::open(&answers).expect("pipe"));
        let mut browser = Self { child, into, from, session: String::new(), count: 0, _folder: folder };
        let target = browser.ask("Target.createTarget", json!({ "url": "about:blank" }))["targetId"].clone();
        let session = browser.ask("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        browser.session = session["sessionId"].as_str().expect("session").into();
        let ratio = if phone { 2 } else { 1 };
        browser.ask(
            "Emulation.setDeviceMetricsOverride",
            json!({ "width": width, "height": height, "deviceScaleFactor": ratio, "mobile": phone }),
        );
        browser.ask("Page.navigate", json!({ "url": format!("file://{}", page.display()) }));
        browser.read("new Promise(done => { const wait = () => document.readyState === 'complete' ? setTimeout(done, 200) : setTimeout(wait, 50); wait(); })");
        browser
    }

    /// Sends a command and waits for its answer; events on the way are passed over.
    fn ask(&mut self, method: &str, parameters: Value) -> Value {
        self.count += 1;
        let mut message = json!({ "id": self.count, "method": method, "params": parameters });
        if !self.session.is_empty() {
            message["sessionId"] = self.session.clone().into();
        }
        self.into.write_all(format!("{message}\0").as_bytes()).expect("the browser listens");
        loop {
            let mut answer = Vec::new();
            self.from.read_until(0, &mut answer).expect("the browser answers");
            answer.pop();
            let answer: Value = serde_json::from_slice(&answer).expect("JSON");
            if answer["id"] == self.count {
                assert!(answer["error"].is_null(), "{method}: {}", answer["error"]);
                return answer["result"].clone();
            }
        }
    }

    /// The value of an expression in the page, waited for if it is a promise.
    pub(crate) fn read(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.ask("Runtime.evaluate", asked);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// The text of an element.
    pub(crate) fn text(&mut self, selector: &str) -> String {
        let text = self.read(&format!("document.querySelector({selector:?})?.textContent ?? ''"));
        text.as_str().unwrap_or_default().to_string()
    }

    /// A place in the window, from an expression that gives `[x, y]` of the page.
    fn at(&mut self, expression: &str) -> (f64, f64) {
        let place = self.read(&format!("(([x, y]) => [x - scrollX, y - scrollY])({expression})"));
        (place[0].as_f64().expect("x"), place[1].as_f64().expect("y"))
    }

    fn mouse(&mut self, kind: &str, (x, y): (f64, f64), shift: bool) {
        let button = if kind == "mouseMoved" { "none" } else { "left" };
        let pressed = u8::from(kind != "mouseReleased");
        let shift = if shift { 8 } else { 0 };
        self.ask(
            "Input.dispatchMouseEvent",
            json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": pressed, "clickCount": 1, "modifiers": shift }),
        );
    }

    /// Clicks at a place given by an expression.
    pub(crate) fn click(&mut self, expression: &str) {
        let at = self.at(expression);
        self.mouse("mousePressed", at, false);
        self.mouse("mouseReleased", at, false);
    }

    /// Presses at one place, moves and lets go at another.
    pub(crate) fn drag(&mut self, from: &str, to: &str, shift: bool) {
        let (from, to) = (self.at(from), self.at(to));
        self.mouse("mousePressed", from, shift);
        for part in 1..=6 {
            let along = |a: f64, b: f64| a + (b - a) * f64::from(part) / 6.0;
            self.mouse("mouseMoved", (along(from.0, to.0), along(from.1, to.1)), shift);
        }
        self.mouse("mouseReleased", to, shift);
    }

    /// Turns the mouse's wheel at a place.
    pub(crate) fn wheel(&mut self, expression: &str, by: f64) {
        let (x, y) = self.at(expression);
        self.ask(
            "Input.dispatchMouseEvent",
            json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": by }),
        );
    }

    /// Presses a key on what has the focus.
    pub(crate) fn key(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.ask("Input.dispatchKeyEvent", json!({ "type": kind, "key": key, "code": key }));
        }
    }

    /// A picture of the window, kept if `VIBES_KEEP_FIGURES` names a folder.
    pub(crate) fn keep(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("VIBES_KEEP_FIGURES") else { return };
        let shot = self.ask("Page.captureScreenshot", json!({ "format": "png" }));
        let png = base64::engine::general_purpose::STANDARD.decode(shot["data"].as_str().expect("picture"));
        std::fs::write(Path::new(&folder).join(name), png.expect("base64")).expect("picture");
    }
}
