#pragma once

#include <optional>
#include <string>
#include <vector>

#include "report/page/value.h"

/// What `avatar eval` left in the folders of runs. Needs no libtorch.
namespace mvstudio::app {

/// RUN/protocol.json.
struct ScoreProtocol {
  std::string path, sha256;
  report::Value body;    ///< what must be equal before scores may be compared
  report::Value splits;  ///< of the easier splits: {kind: {"pictures", "sha256"}}
};
/// Throws IoError (saying that `avatar eval` writes it) or FormatError, also when the digest does not fit the content.
ScoreProtocol ReadScoreProtocol(const std::string& run_folder);

/// The first field, in the file's order, in which two protocols differ: "crop.size_px is 96, in RUN_A it is 128". Empty: equal.
std::string FirstDifference(const ScoreProtocol& own, const ScoreProtocol& first);
/// Throws FormatError with that field.
void RequireSameProtocol(const ScoreProtocol& own, const ScoreProtocol& first);

/// One scored run.
struct ScoredRun {
  std::string folder;
  std::string label;      ///< as the user named it; may be empty
  report::Value metrics;  ///< of avatar_eval.result.json
  ScoreProtocol protocol;
};
/// From "RUN" or "NAME=RUN". Throws IoError, FormatError.
ScoredRun ReadScoredRun(const std::string& text);

/// "NAME=FOLDER" -> both parts; a folder alone gets an empty name. A folder that exists and has '=' in its name is a folder.
std::pair<std::string, std::string> SplitLabel(const std::string& text);

}  // namespace mvstudio::app
