#include "cli/footage.h"

#include <filesystem>
#include <memory>
#include <set>

#include "core/error.h"
#include "dataset/frames.h"

namespace mvstudio::cli {
namespace {

/// The last number in a file name without its extension, if any.
std::optional<int64_t> TrailingNumber(const std::string& file_name) {
  const std::string stem = std::filesystem::path(file_name).stem().string();
  const auto last = stem.find_last_of("0123456789");
  if (last == std::string::npos) return std::nullopt;
  const auto before = stem.find_last_not_of("0123456789", last);
  const std::string digits = stem.substr(before + 1, last - before);
  if (digits.size() > 18) return std::nullopt;
  return std::stoll(digits);
}

calib::Footage OpenOne(const std::string& name, const std::string& path) {
  const std::shared_ptr<dataset::FrameSource> source = dataset::OpenFrames(path);
  calib::Footage footage;
  footage.camera = name;
  footage.path = path;
  footage.num_frames = source->num_frames();
  footage.next = [source]() -> std::optional<calib::FootageFrame> {
    auto frame = source->Next();
    if (!frame) return std::nullopt;
    const bool is_file = frame->label.rfind("frame ", 0) != 0;
    const auto number = is_file ? TrailingNumber(frame->label) : std::nullopt;
    return calib::FootageFrame{number.value_or(frame->frame_idx), frame->label, std::move(frame->rgb)};
  };
  return footage;
}

}  // namespace

std::vector<calib::Footage> OpenFootage(const std::vector<std::string>& cameras, CommandResult* result) {
  if (cameras.empty()) throw UsageError("--camera NAME=PATH is needed at least once");
  std::vector<calib::Footage> footage;
  std::set<std::string> names;
  for (const std::string& text : cameras) {
    const auto [name, path] = SplitNamePath("--camera", text);
    if (!names.insert(name).second) throw UsageError("--camera " + name + " is given twice");
    footage.push_back(OpenOne(name, path));
    result->inputs.push_back(path);
  }
  return footage;
}

}  // namespace mvstudio::cli
