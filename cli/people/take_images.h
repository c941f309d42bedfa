#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/people/take_timing.h"
#include "stages/input/session_input.h"
#include "stages/people/joint_views.h"

namespace CLI {
class App;
}

/// Footage of a take that is not an input of its points: for the report's images.
namespace mvstudio::cli {

struct ImageArguments {
  std::vector<stages::NamedPath> video, images;

  std::vector<std::string> Paths() const;
};

/// Adds --video and --images.
void AddImageArguments(CLI::App* sub, ImageArguments& arguments);

/// Throws IoError or FormatError for paths without footage.
void CheckFootage(const ImageArguments& arguments);

/// The frame rate that all of its videos state; 0 without videos, or where they differ.
double FootageRateHz(const ImageArguments& arguments);

/// Throws UsageError for cameras that the rig lacks.
void CheckCameras(const ImageArguments& arguments, const geometry::Rig& rig, const std::string& calib_path);

/// What is named, else the session's, where the frames of the take can be found in it.
stages::TakeImages ImagesOf(const std::optional<stages::FoundTake>& found, const TimingArguments& timing,
                            const ImageArguments& arguments, const FrameNumbering& numbering);

}  // namespace mvstudio::cli
