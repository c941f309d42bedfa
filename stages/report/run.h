#pragma once

#include <functional>
#include <string>

#include "stages/report/options.h"

namespace mvstudio::stages {

struct PageReport {
  PageOptions options;
  report::Report page;
  std::string html_path, json_path;  ///< that were written
};

/// Changes the texts of a page before it is written.
using PageChange = std::function<void(report::Report*)>;

/// Makes and writes the page of one run, or of several side by side. Throws UsageError, IoError.
PageReport RunPage(const PageOptions& options, const PageChange& change = {});

}  // namespace mvstudio::stages
