//! A headless Chromium, driven by its own protocol over two pipes. What the page says on its console, and what it asks the network for, is
//! kept.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use serde_json::{Value, json};

use crate::stage::{PATIENCE, wait_until};

/// A page in a browser.
pub struct Browser {
    process: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    last_id: u64,
    session: Option<String>,
    /// Errors and warnings that the page had, and addresses that it asked for beside its own.
    pub trouble: Vec<String>,
}

impl Browser {
    /// The browser that `RELOOP_CHROMIUM` names; none, with a word about it, where it names none. On a loaded machine a headless browser may
    /// stop giving animation frames for a minute, so nobody is tested by it unasked.
    pub fn find() -> Option<PathBuf> {
        let found = std::env::var_os("RELOOP_CHROMIUM").map(PathBuf::from).filter(|program| program.is_file());
        if found.is_none() {
            eprintln!(
                "skipped: RELOOP_CHROMIUM names no browser (apt-get install chromium, RELOOP_CHROMIUM=/usr/bin/chromium)"
            );
        }
        found
    }

    /// Opens the file `page` in `program`, whose own files go into `folder`.
    pub fn open(program: &Path, folder: &Path, page: &Path) -> Self {
        let profile = format!("--user-data-dir={}", folder.display());
        // It speaks through descriptors 3 and 4: they are made of the pipes that a child has anyway.
        let mut command = Command::new("sh");
        command.args(["-c", "exec \"$0\" \"$@\" 3<&0 4>&1 </dev/null >/dev/null"]).arg(program);
        command.args([
            "--headless=new",
            "--remote-debugging-pipe",
            "--no-first-run",
            "--disable-gpu",
            "--hide-scrollbars",
            // A page that it takes to be out of sight gets no animation frames.
            "--disable-backgrounding-occluded-windows",
            "--disable-renderer-backgrounding",
            "--disable-background-timer-throttling",
        ]);
        // In a container there is neither a sandbox to be had nor much shared memory.
        command.args(["--no-sandbox", "--disable-dev-shm-usage", &profile, "about:blank"]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut process = command.spawn().unwrap();
        let (to, out) = (process.stdin.take().unwrap(), process.stdout.take().unwrap());
        let (heard, from) = sync_channel(1024);
        thread::spawn(move || {
            for message in BufReader::new(out).split(0).map_while(Result::ok) {
                if heard.send(serde_json::from_slice(&message).unwrap()).is_err() {
                    return;
                }
            }
        });
        let mut browser = Self { process, to, from, last_id: 0, session: None, trouble: Vec::new() };
        let target = browser.ask("Target.createTarget", &json!({ "url": "about:blank" }));
        let attached =
            browser.ask("Target.attachToTarget", &json!({ "targetId": target["targetId"], "flatten": true }));
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Runtime", "Log", "Network", "Page"] {
            browser.ask(&format!("{domain}.enable"), &json!({}));
        }
        browser.ask("Page.bringToFront", &json!({}));
        browser.ask("Emulation.setFocusEmulationEnabled", &json!({ "enabled": true }));
        browser.ask("Page.navigate", &json!({ "url": format!("file://{}", page.display()) }));
        browser
    }

    /// A command of the protocol, and what came of it.
    pub fn ask(&mut self, method: &str, parameters: &Value) -> Value {
        self.last_id += 1;
        let mut message = json!({ "id": self.last_id, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        self.to.write_all(message.to_string().as_bytes()).unwrap();
        self.to.write_all(&[0]).unwrap();
        loop {
            let heard = self.from.recv_timeout(PATIENCE).unwrap_or_else(|error| panic!("{method}: {error}"));
            if heard["id"] == json!(self.last_id) {
                assert!(heard.get("error").is_none(), "{method}: {heard}");
                return heard["result"].clone();
            }
            self.listen(&heard);
        }
    }

    fn listen(&mut self, heard: &Value) {
        let said = &heard["params"];
        match heard["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" => self.trouble.push(said.to_string()),
            // Warnings of the browser's own are on how the test reads pixels.
            "Log.entryAdded" if said["entry"]["level"] == "error" => self.trouble.push(said.to_string()),
            "Runtime.consoleAPICalled" if said["type"] != "log" => self.trouble.push(said.to_string()),
            "Network.requestWillBeSent" => {
                let url = said["request"]["url"].as_str().unwrap_or_default();
                if !url.starts_with("file:") && !url.starts_with("data:") && url != "about:blank" {
                    self.trouble.push(format!("asks for {url}"));
                }
            }
            _ => {}
        }
    }

    /// What an expression of the page's comes to.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let told = self.ask("Runtime.evaluate", &asked);
        assert!(told.get("exceptionDetails").is_none(), "{expression}: {told}");
        told["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait_for(&mut self, expression: &str) {
        wait_until(expression, || self.value(&format!("Boolean({expression})")) == json!(true));
    }

    /// Clicks at a share of an element's width.
    pub fn click_at(&mut self, selector: &str, share: f64) {
        let quoted = json!(selector);
        let place = self.value(&format!(
            "(() => {{ const one = document.querySelector({quoted}); one.scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
             const {{ x, y, width, height }} = one.getBoundingClientRect(); return [x + width * {share}, y + height / 2]; }})()"
        ));
        for kind in ["mousePressed", "mouseReleased"] {
            let event =
                json!({ "type": kind, "x": place[0], "y": place[1], "button": "left", "clickCount": 1, "buttons": 1 });
            self.ask("Input.dispatchMouseEvent", &event);
        }
    }

    /// Clicks in the middle of an element.
    pub fn click(&mut self, selector: &str) {
        self.click_at(selector, 0.5);
    }

    /// Presses a key; `shift` holds it down beside.
    pub fn press(&mut self, key: &str, shift: bool) {
        let modifiers = if shift { 8 } else { 0 };
        for kind in ["rawKeyDown", "keyUp"] {
            self.ask("Input.dispatchKeyEvent", &json!({ "type": kind, "key": key, "modifiers": modifiers }));
        }
    }

    /// A screen of that many pixels; a phone's has three dots a pixel, and is touched.
    pub fn screen(&mut self, width: u32, height: u32, phone: bool) {
        let factor = if phone { 3 } else { 1 };
        let screen = json!({ "width": width, "height": height, "deviceScaleFactor": factor, "mobile": phone });
        self.ask("Emulation.setDeviceMetricsOverride", &screen);
    }

    /// `light` or `dark`, and `screen` or `print`.
    pub fn media(&mut self, scheme: &str, media: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.ask("Emulation.setEmulatedMedia", &json!({ "media": media, "features": features }));
    }

    /// Keeps a picture of the screen, or of the whole page, where `RELOOP_SCREENSHOTS` says.
    pub fn picture(&mut self, name: &str, whole: bool) {
        use base64::Engine as _;
        let Some(folder) = std::env::var_os("RELOOP_SCREENSHOTS") else { return };
        let taken = self.ask("Page.captureScreenshot", &json!({ "format": "png", "captureBeyondViewport": whole }));
        let bytes = base64::engine::general_purpose::STANDARD.decode(taken["data"].as_str().unwrap()).unwrap();
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may be gone already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
