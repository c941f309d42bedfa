#include "app/input/board_footage.h"

#include <memory>
#include <set>

#include "app/input/take_input.h"
#include "core/error.h"
#include "dataset/footage/frames.h"

namespace mvstudio::app {
namespace {

calib::Footage OpenOne(const std::string& name, const std::string& path) {
  const std::shared_ptr<dataset::FrameSource> source = dataset::OpenFrames(path, {false, true, true});
  calib::Footage footage;
  footage.camera = name;
  footage.path = path;
  footage.num_frames = source->num_frames();
  footage.next = [source]() -> std::optional<calib::FootageFrame> {
    auto frame = source->Next();
    if (!frame) return std::nullopt;
    return calib::FootageFrame{frame->number, frame->label, std::move(frame->rgb)};
  };
  return footage;
}

}  // namespace

std::vector<calib::Footage> OpenFootage(const std::vector<NamedPath>& cameras, CommandResult* result) {
  if (cameras.empty()) throw UsageError("option 'camera' NAME=PATH is needed at least once");
  std::vector<calib::Footage> footage;
  std::set<std::string> names;
  for (const auto& [name, path] : cameras) {
    if (!names.insert(name).second) throw UsageError("option 'camera' " + name + " is given twice");
    footage.push_back(OpenOne(name, path));
    result->inputs.push_back(path);
  }
  RefuseSameFootage(cameras, false);
  return footage;
}

}  // namespace mvstudio::app
