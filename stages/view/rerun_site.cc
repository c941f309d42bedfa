#include "stages/view/rerun_site.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/view/view_page.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

constexpr char kPackage[] = "node_modules/@rerun-io/web-viewer", kMcapBegin[] = "\x89MCAP0\r\n",
               kMessagesName[] = "recording.mcap";
constexpr uint64_t kMostBytes = uint64_t{1} << 30;  // a browser's page holds it, and what it becomes
constexpr const char* kPackageFiles[] = {"index.js", "re_viewer.js", "re_viewer_bg.wasm"};

// The viewer compiles WebAssembly and sets styles; it reaches this server alone.
constexpr char kRerunPolicy[] =
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; connect-src 'self' data: "
    "blob:; "
    "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

constexpr char kRerunPage[] = R"html(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>mvstudio view: Rerun</title>
<link rel="icon" href="icon.svg">
<style>html, body, #view { margin: 0; width: 100%; height: 100%; overflow: hidden; font: 15px system-ui, sans-serif; }
#told { position: absolute; left: 1rem; top: 1rem; margin: 0; }</style>
</head>
<body>
<div id="view"></div>
<p id="told" role="status">Loading Rerun's viewer</p>
<script type="module" src="rerun.js"></script>
</body>
</html>
)html";

constexpr char kRerunScript[] = R"js(import { WebViewer } from './index.js';

const told = document.getElementById('told');
const viewer = new WebViewer();
viewer.start(new URL('recording.mcap', location.href).href, document.getElementById('view'),
             { width: '100%', height: '100%', hide_welcome_screen: true, allow_fullscreen: true }).then(
  () => { told.hidden = true; document.body.dataset.state = 'ready'; },
  (error) => { told.textContent = "Rerun's viewer did not start: " + error; document.body.dataset.state = 'failed'; });
setInterval(() => fetch('alive').catch(() => { told.hidden = false; told.textContent = 'mvstudio view has ended'; }), 2000);
addEventListener('pagehide', () => fetch('bye', { keepalive: true }));
)js";

bool IsPackage(const fs::path& folder) {
  std::error_code none;
  for (const char* name : kPackageFiles) {
    if (!fs::is_regular_file(folder / name, none)) return false;
  }
  return true;
}

}  // namespace

bool IsMessagesFile(const std::string& path) { return fs::path(path).extension() == ".mcap"; }

std::string RerunFolder(const std::string& given, const std::string& path) {
  std::error_code none;
  if (!fs::is_regular_file(path, none)) throw IoError(path, "is no file that is there");
  if (!given.empty()) {
    if (IsPackage(given)) return given;
    throw UsageError("option 'rerun' " + given +
                     ": is no folder of the npm package @rerun-io/web-viewer (index.js, re_viewer.js, " + "re_viewer_bg.wasm)");
  }
  if (const fs::path here = fs::current_path(none) / kPackage; IsPackage(here)) return here.string();
  throw MissingToolError(
      path +
      ": is shown by Rerun's viewer, which is not in the working folder's node_modules: npm install @rerun-io/web-viewer, or "
      "name its folder by option 'rerun'; Rerun and Foxglove open the file, too");
}

RerunSite::RerunSite(const ViewOptions& options, std::string package)
    : file_(options.scene.path), package_(std::move(package)), page_(kRerunPage), life_(options.idle_min) {
  std::error_code none;
  const auto bytes = fs::file_size(file_, none);
  if (none) throw IoError(file_, "cannot be read");
  if (bytes > kMostBytes)
    throw ResourceError(file_ + ": has more than 1 GiB, too much for a page; Rerun and Foxglove open it from the disk");
  const std::string file = ReadFile(file_);
  if (file.compare(0, sizeof kMcapBegin - 1, kMcapBegin) != 0)
    throw FormatError(file_, "", "is no MCAP file: make one by mvstudio dataset export with option 'to' mcap");
}

PageAnswer RerunSite::operator()(const PageRequest& request) {
  life_.Ask(request.path);
  if (request.method != "GET") return {405, "text/plain; charset=utf-8", "GET only\n"};
  const std::string script = "text/javascript; charset=utf-8";
  if (request.path.empty()) return {200, "text/html; charset=utf-8", page_, kRerunPolicy};
  if (request.path == "icon.svg") return {200, "image/svg+xml", ViewPageIcon()};
  if (request.path == "rerun.js") return {200, script, kRerunScript};
  if (request.path == kMessagesName) return {200, "application/octet-stream", ReadFile(file_)};
  if (request.path == "index.js") return {200, script, ReadFile(package_ + "/index.js")};
  if (request.path == "re_viewer" || request.path == "re_viewer.js")  // the package imports it without its ending
    return {200, script, ReadFile(package_ + "/re_viewer.js")};
  if (request.path == "re_viewer_bg.wasm") return {200, "application/wasm", ReadFile(package_ + "/re_viewer_bg.wasm")};
  if (request.path == "alive" || request.path == "bye") return {200, "text/plain; charset=utf-8", ""};
  return {404, "text/plain; charset=utf-8", "not here\n"};
}

}  // namespace mvstudio::stages
