#pragma once

#include <functional>
#include <vector>

#include "core/progress.h"
#include "stages/input/pose_input.h"
#include "stages/triangulate/report.h"

namespace mvstudio::stages {

/// Frames of a take that stand for all of it.
using SampleFrames = std::function<std::vector<triangulate::DetectedFrame>()>;

/// As many frames as a chunk has, in runs spread over the take.
std::vector<triangulate::DetectedFrame> SampleOf(const PoseParts& parts, size_t chunk);

/// Solves the take and writes its points: TriangulateReport::take, filter, refinement, and files of the project.
void SolveWhole(const PoseInput& input, const RunContext& run, PointStatistics* statistics, TriangulateReport* report);

/// The same chunk by chunk: noise and method from frames spread over the take.
void SolveChunks(const PoseParts& parts, const RunContext& run, PointStatistics* statistics, TriangulateReport* report);

/// What the points say of the take: TriangulateReport::points, loss, limbs, trunk_tilt_deg, inconsistency and, where something
/// is wrong or may be, its causes.
void JudgeTake(const PoseInput& input, const PointStatistics& statistics, const SampleFrames& sample, const RunContext& run,
               TriangulateReport* report);

/// Whether its figures say that the detections do not match the calibration; `diagonal_px`: of the images.
Inconsistency InconsistencyOf(const triangulate::TakeResult& take, double diagonal_px);

/// The cameras as the take is solved with them.
geometry::Rig SolvedRig(const TriangulateReport& report);

}  // namespace mvstudio::stages
