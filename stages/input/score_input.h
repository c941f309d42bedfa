#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/pose/score_scale.h"
#include "stages/input/pose_changes.h"

/// Scores of 2D joints become shares of 1, whatever their program counts.
namespace mvstudio::stages {

/// The scale of each camera's scores. Those of one table (`one_source`) have one. Says what is divided or cut off
/// (`POSE-SCORES`). Throws FormatError for logits and for what has no known scale.
std::map<std::string, dataset::ScoreScale> ScoreScalesOf(const std::vector<dataset::Pose2dTrack>& tracks, bool one_source,
                                                         InputNotes* notes);

/// Makes them shares of 1 by ScoreScalesOf; nothing with `changes.ignore_scores`.
void ScoresToShares(const PoseChanges& changes, bool one_source, std::vector<dataset::Pose2dTrack>* tracks, InputNotes* notes);

}  // namespace mvstudio::stages
