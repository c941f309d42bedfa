#include "stages/input/score_input.h"

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::stages {
namespace {

using dataset::Pose2dTrack;
using dataset::ScoreCounts;
using dataset::ScoreScale;

constexpr char kLimitHint[] = "option 'min-score' counts from 0 to 1; with option 'ignore-scores' they say nothing";

[[noreturn]] void Refuse(const std::string& cameras, const ScoreCounts& counts, const char* what) {
  throw FormatError(
      cameras, "scores",
      Format("are %.4g to %.4g: %s; write shares of 1, or give option 'ignore-scores'", counts.least, counts.most, what));
}

void Tell(const std::string& cameras, const ScoreCounts& counts, ScoreScale scale, InputNotes* notes) {
  const std::string up_to = Format("scores of %s go up to %.4g", cameras.c_str(), counts.most);
  const auto say = [&](const std::string& text) { notes->warnings.push_back({"POSE-SCORES", up_to + text, kLimitHint}); };
  switch (scale) {
    case ScoreScale::kOne:
      // One odd number among shares of 1 may be damage; peaks a little above 1 are usual.
      if (counts.most > 20)
        say(Format(": %lld of %lld are above 1 and count as 1", static_cast<long long>(counts.num_above),
                   static_cast<long long>(counts.num)));
      return;
    case ScoreScale::kFlags:
      return;
    case ScoreScale::kPercent:
      return say(": they are percent, and were divided by 100");
    case ScoreScale::kBytes:
      return say(": they are whole numbers of a byte, and were divided by 255");
    case ScoreScale::kPeaks:
      return say(": they are no shares of 1; what is above 1 counts as 1");
    case ScoreScale::kLogits:
      Refuse(cameras, counts, "a network's outputs before the sigmoid (logits)");
    case ScoreScale::kUnknown:
      Refuse(cameras, counts, "neither shares of 1 nor percent nor bytes");
  }
}

}  // namespace

std::map<std::string, ScoreScale> ScoreScalesOf(const std::vector<Pose2dTrack>& tracks, bool one_source, InputNotes* notes) {
  std::map<std::string, ScoreScale> scales;
  if (one_source) {
    ScoreCounts counts;
    for (const Pose2dTrack& track : tracks) counts.Add(track);
    Tell("the table", counts, counts.Scale(), notes);
    for (const Pose2dTrack& track : tracks) scales[track.camera] = counts.Scale();
    return scales;
  }
  for (const Pose2dTrack& track : tracks) {
    ScoreCounts counts;
    counts.Add(track);
    Tell("camera " + track.camera, counts, scales[track.camera] = counts.Scale(), notes);
  }
  return scales;
}

void ScoresToShares(const PoseChanges& changes, bool one_source, std::vector<Pose2dTrack>* tracks, InputNotes* notes) {
  if (changes.ignore_scores) return;
  const std::map<std::string, ScoreScale> scales = ScoreScalesOf(*tracks, one_source, notes);
  for (Pose2dTrack& track : *tracks) dataset::ScoresToShares(scales.at(track.camera), &track);
}

}  // namespace mvstudio::stages
