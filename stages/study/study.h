#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/result.h"

/// `mvstudio report --study` and `--study-tally`.
namespace mvstudio::stages {

struct StudyArguments {
  std::vector<std::string> sides;  ///< two folders of images or two scored runs, each "NAME=FOLDER" or "FOLDER"
  std::string truth;               ///< folder of the true images; determined automatically for runs
  std::string title;
  int images = 40;
  bool follow_links = false;       ///< read images through links that lead out of their folder
  std::vector<std::string> tally;  ///< files of answers
};

/// Writes the page to `out` and its key beside it with the extension .key.json.
CommandResult RunStudy(const StudyArguments& arguments, const std::string& out, uint64_t seed);

CommandResult RunStudyTally(const StudyArguments& arguments);

}  // namespace mvstudio::stages
