#pragma once

#include <string>
#include <vector>

#include "core/choice/option_style.h"

/// Scored runs as one table: what a caller gives.
namespace mvstudio::stages {

struct AvatarCompareOptions {
  std::vector<std::string> runs;   ///< folders, or NAME=RUN
  std::vector<std::string> study;  ///< answers to user studies between rows
  std::string out;                 ///< Markdown; empty: none
  bool baselines = true;
};

/// Without the runs.
template <class Visitor>
void VisitFields(Visitor&& visit, AvatarCompareOptions& o) {
  visit("study", o.study, "answers to user studies between rows (mvstudio report option 'study')");
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "also write the table as Markdown");
  VisitStyled(visit, OptionStyle::kUnset, "baselines", o.baselines,
              "rows of the fitted body, the mean image and the nearest view");
}

}  // namespace mvstudio::stages
