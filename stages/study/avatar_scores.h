#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "report/page/value.h"

/// Results of `avatar eval` in the folders of runs. Needs no libtorch.
namespace mvstudio::stages {

/// RUN/protocol.json.
struct ScoreProtocol {
  std::string path, sha256;
  report::Value body;                                    ///< must be equal for scores to be comparable
  report::Value splits;                                  ///< of the easier splits: {kind: {"pictures", "sha256"}}
  std::map<std::string, std::string> studio_names = {};  ///< of the dataset's cameras, for messages; empty: not known
};
/// Throws IoError (saying that `avatar eval` writes it) or FormatError, also when the digest does not match the content.
ScoreProtocol ReadScoreProtocol(const std::string& run_folder);

/// The first field, in the file's order, in which two protocols differ: "crop.size_px is 96, in RUN_A it is 128". Empty:
/// equal.
std::string FirstDifference(const ScoreProtocol& own, const ScoreProtocol& first);
/// Throws FormatError with that field.
void RequireSameProtocol(const ScoreProtocol& own, const ScoreProtocol& first);

/// One scored run.
struct ScoredRun {
  std::string folder;
  std::string label;      ///< given by the user; may be empty
  report::Value metrics;  ///< of avatar_eval.result.json
  report::Value timing;   ///< of the same
  report::Value train;    ///< avatar_train.result.json; null where there is none
  ScoreProtocol protocol;
};
/// From "RUN" or "NAME=RUN". Throws IoError, FormatError.
ScoredRun ReadScoredRun(const std::string& text);

/// "NAME=FOLDER" -> both parts; a folder alone gets an empty name. An existing folder with '=' in its name is a folder.
std::pair<std::string, std::string> SplitLabel(const std::string& text);

}  // namespace mvstudio::stages
