#include "stages/input/board_footage.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "core/error.h"
#include "core/format.h"
#include "core/some_of.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "stages/input/take_input.h"

namespace mvstudio::stages {
namespace {

/// Long and short side of an image, however it is turned.
using Sides = std::pair<int64_t, int64_t>;
Sides SidesOf(int64_t width, int64_t height) { return {std::max(width, height), std::min(width, height)}; }

/// Positions of images of another size than more than half of the camera's have; none where no size has that many: that is
/// refused when they are read. `sizes`: theirs, in words.
std::vector<size_t> OfOtherSize(const std::vector<std::string>& files, std::string* sizes) {
  std::map<Sides, std::vector<size_t>> of_size;
  for (size_t i = 0; i < files.size(); ++i) {
    try {
      const dataset::ImageHeader header = dataset::ReadImageHeader(files[i]);
      of_size[SidesOf(header.width, header.height)].push_back(i);
    } catch (const Error&) {  // reading it says why
    }
  }
  const auto fewer = [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); };
  const auto most = std::max_element(of_size.begin(), of_size.end(), fewer);
  if (of_size.size() < 2 || 2 * most->second.size() <= files.size()) return {};
  const auto text = [](const Sides& sides) { return std::to_string(sides.first) + "x" + std::to_string(sides.second); };
  std::vector<size_t> others;
  for (const auto& [sides, positions] : of_size) {
    if (sides == most->first) continue;
    others.insert(others.end(), positions.begin(), positions.end());
    *sizes += text(sides) + ", ";
  }
  *sizes += "most are " + text(most->first);
  return others;
}

std::vector<size_t> WithoutNumber(const dataset::FrameNumbers& numbers) {
  std::vector<size_t> positions;
  for (size_t i = 0; i < numbers.without_number.size(); ++i) {
    if (numbers.without_number[i]) positions.push_back(i);
  }
  return positions;
}

/// Positions of images that are not the camera's, or belong to no time step.
std::set<int64_t> LeftOut(const NamedPath& camera, bool alone, InputNotes* notes) {
  const dataset::FootageFiles files = dataset::ListFootage(camera.path);
  if (files.is_video) return {};
  std::set<int64_t> left_out;
  const auto add = [&](const std::vector<size_t>& positions, const std::string& why, const char* hint) {
    if (positions.empty()) return;
    std::vector<std::string> names;
    for (const size_t i : positions) {
      left_out.insert(static_cast<int64_t>(i));
      names.push_back(std::filesystem::path(files.paths[i]).filename().string());
    }
    notes->warnings.push_back({"CAL-UNUSED",
                               Format("camera %s: %zu of %zu images ", camera.name.c_str(), names.size(), files.paths.size()) +
                                   why + " and are left out: " + SomeOf(names),
                               hint});
  };
  std::string sizes;
  const std::vector<size_t> others = OfOtherSize(files.paths, &sizes);
  add(others, "have another size (" + sizes + ")", "a lens belongs to one size: take those of one camera and mode");
  if (!alone)
    add(WithoutNumber(files.images), "have no number in their names", "number them as the frames of the other cameras are");
  return left_out;
}

calib::Footage OpenOne(const NamedPath& camera, bool alone, InputNotes* notes) {
  const std::shared_ptr<dataset::FrameSource> source = dataset::OpenFrames(camera.path, {false, true, true});
  calib::Footage footage;
  footage.camera = camera.name;
  footage.path = camera.path;
  footage.num_frames = source->num_frames();
  footage.next = [source, left_out = LeftOut(camera, alone, notes)]() -> std::optional<calib::FootageFrame> {
    auto frame = source->Advance();
    while (frame && left_out.count(frame->frame_idx) > 0) frame = source->Advance();
    if (!frame) return std::nullopt;
    return calib::FootageFrame{frame->number, frame->label, source->FullImage()};
  };
  return footage;
}

}  // namespace

std::vector<calib::Footage> OpenFootage(const std::vector<NamedPath>& cameras, InputNotes* notes) {
  if (cameras.empty()) throw UsageError("option 'camera' NAME=PATH is needed at least once");
  std::vector<calib::Footage> footage;
  std::set<std::string> names;
  for (const NamedPath& camera : cameras) {
    if (!names.insert(camera.name).second) throw UsageError("option 'camera' " + camera.name + " is given twice");
    footage.push_back(OpenOne(camera, cameras.size() == 1, notes));
    notes->inputs.push_back(camera.path);
  }
  RefuseSameFootage(cameras, false);
  return footage;
}

}  // namespace mvstudio::stages
