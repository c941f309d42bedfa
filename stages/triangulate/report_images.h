#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/input/session_input.h"
#include "stages/triangulate/joint_views.h"
#include "stages/triangulate/options.h"
#include "stages/triangulate/timing.h"

/// Footage of a take that is not an input of its points: for the report's images.
namespace mvstudio::stages {

/// All that is named.
std::vector<std::string> FootagePaths(const TriangulateOptions& options);

/// Throws IoError or FormatError for paths without footage.
void CheckFootage(const TriangulateOptions& options);

/// The frame rate that all of its videos state; 0 without videos, or where they differ.
double FootageRateHz(const TriangulateOptions& options);

/// Throws UsageError for footage of cameras that the rig lacks.
void CheckFootageCameras(const TriangulateOptions& options, const geometry::Rig& rig);

/// What is named, else the session's, where the frames of the take can be found in it.
TakeImages ImagesOf(const std::optional<FoundTake>& found, const TriangulateOptions& options, const TakeTiming& timing);

}  // namespace mvstudio::stages
