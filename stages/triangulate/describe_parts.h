// Private: the parts of Describe, for its two files.
#pragma once

#include <string>
#include <vector>

#include "stages/result.h"
#include "stages/triangulate/report.h"

namespace mvstudio::stages {

/// Metrics of the points: counts, medians, limbs, joints.
nlohmann::ordered_json PointMetrics(const PointFigures& points);
/// Noise, method, held-out figures and the judgement of the cameras.
nlohmann::ordered_json TakeMetrics(const triangulate::TakeResult& take, const geometry::Skeleton& skeleton);

/// Metrics `filter_holdout` and a line of text; a warning where the filter hurts.
CommandResult DescribeFilter(const FilterCheck& check);
/// Metrics `refinement`, terms that were tried and their effect on limbs; a line with those in use.
CommandResult DescribeRefinement(const triangulate::SkeletonRefineReport& report);

/// Cameras that almost never see anybody, and frames with more people than are kept.
std::vector<Notice> DetectionNotices(const PointFigures& points, int max_persons);
/// Cameras that are off or scaled, that fit no point, or that swap left and right.
std::vector<Notice> CameraNotices(const triangulate::TakeResult& take);

/// Too few points, or none: an error (exit 4 or 5), with the reason where the scores or the statuses are it.
CommandResult DescribeLoss(const Loss& loss, const PointFigures& points, const triangulate::TakeOptions& options);
/// An error, exit 4.
CommandResult DescribeInconsistency(const TriangulateReport& report);

}  // namespace mvstudio::stages
