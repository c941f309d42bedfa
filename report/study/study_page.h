#pragma once

#include <string>
#include <vector>

#include "report/study/study.h"

namespace mvstudio::report {

/// A question as it is asked.
struct StudyQuestion {
  const StudyImage* image;
  bool a_left;
  std::string seal;
};

/// The page of a study. Keys: left and right arrow choose, Backspace undoes the last answer.
std::string StudyPageHtml(const StudySpec& spec, const std::string& sha256, const std::vector<StudyQuestion>& questions);

}  // namespace mvstudio::report
