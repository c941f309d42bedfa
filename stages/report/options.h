#pragma once

#include <string>
#include <vector>

#include "core/choice/option_style.h"
#include "report/report.h"

/// The page of a run, or of several side by side: what a caller gives.
namespace mvstudio::stages {

struct PageOptions {
  std::vector<std::string> runs;  ///< folders; of several, the earliest first
  std::string out;                ///< the page; empty: report.html in the run, or comparison.html in the last of several
  report::ReportOptions page;
};

/// Without the runs.
template <class Visitor>
void VisitFields(Visitor&& visit, PageOptions& o) {
  VisitStyled(visit, OptionStyle::kFile, "out", o.out,
              "the page; the numbers go beside it with the extension .json (default: RUN/report.html, of several "
              "LAST/comparison.html)");
  VisitFields(visit, o.page);
}

}  // namespace mvstudio::stages
