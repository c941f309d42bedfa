#pragma once

#include <functional>
#include <string>

#include "core/progress.h"
#include "stages/click/click_scene.h"
#include "stages/click/options.h"
#include "stages/input_notes.h"

namespace mvstudio::stages {

/// What a browser asks for: GET of "", "scene.json", "image/0.jpg" and the like, or POST of clicks.
struct ClickRequest {
  std::string method, path, body;
};
struct ClickAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
};

/// Shows the page to somebody: each request has its answer, until `ended` is true.
using ClickServer =
    std::function<void(const std::function<ClickAnswer(const ClickRequest&)>& answer, const std::function<bool()>& ended)>;

struct ClickReport {
  ClickOptions options;  ///< as the session settled them
  InputNotes notes;
  ClickScene scene;         ///< with what was clicked
  bool is_written = false;  ///< there is a table of clicks
};

/// Points are clicked on the page that `serve` shows; the table is saved after each click. Throws UsageError, IoError and
/// FormatError, and CancelledError, which says what is saved.
ClickReport RunClick(ClickOptions options, const ClickServer& serve, const RunContext& run = {});

}  // namespace mvstudio::stages
