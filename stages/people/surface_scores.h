#pragma once

#include <string>

#include "avatar/body/measure/body_scores.h"
#include "stages/result.h"

/// What `avatar surface` says of a fitted body.
namespace mvstudio::stages {

/// Adds one entry of metrics["bodies"], a row of the table for each set of frames ("fitted": their images took part in the fit;
/// "other": the rest), and warnings. `path` names the body. Exit code kExitBadInput when body and truth share no frame,
/// kExitPartial when some frames have no score.
void AddSurfaceScores(const std::string& path, const body::BodyScores& scores, CommandResult* result);

/// The head of the table; its lengths are centimetres.
std::string SurfaceTableHead();

}  // namespace mvstudio::stages
