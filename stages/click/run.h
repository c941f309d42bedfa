#pragma once

#include <string>

#include "core/progress.h"
#include "stages/click/click_scene.h"
#include "stages/click/options.h"
#include "stages/input_notes.h"
#include "stages/serve/page_server.h"

namespace mvstudio::stages {

struct ClickReport {
  ClickOptions options;  ///< as the session settled them
  InputNotes notes;
  ClickScene scene;         ///< with what was clicked
  bool is_written = false;  ///< there is a table of clicks
};

/// Points are clicked on the page that `serve` shows; the table is saved after each click. Throws UsageError, IoError and
/// FormatError, and CancelledError, which says what is saved.
ClickReport RunClick(ClickOptions options, const ShowPage& serve, const RunContext& run = {});

}  // namespace mvstudio::stages
