#pragma once

#include "core/progress.h"
#include "stages/serve/page_server.h"
#include "stages/view/scene.h"

namespace mvstudio::stages {

/// The report page of a folder with results, under a title (empty: the folder's name); empty: it has none. Nothing is written.
using MakeReportPage = std::function<std::string(const std::string& folder, const std::string& title)>;

struct ViewReport {
  ViewOptions options;
  InputNotes notes;
  Scene scene;
  bool has_report = false;
  int64_t num_images = 0;  ///< that were sent
};

/// Shows a run, a session, a dataset, a calibration or points to the browser that `show` serves, until its page is closed.
/// Throws UsageError, IoError and FormatError.
ViewReport RunView(const ViewOptions& options, const MakeReportPage& report, const ShowPage& show, const RunContext& run = {});

}  // namespace mvstudio::stages
