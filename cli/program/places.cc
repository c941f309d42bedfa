#include "cli/program/places.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "core/disk/output.h"
#include "core/disk/replace.h"

namespace mvstudio::cli {
namespace {

bool HasMark(CLI::Option* option, const char* mark) {
  try {
    return option->get_validator(mark) != nullptr;
  } catch (const CLI::OptionNotFound&) {
    return false;
  }
}

void CheckFile(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return;  // `markers convert` writes into one
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  RequireRoomIn(parent.empty() ? "." : parent.string());
  const OutputFiles place({path}, {});
}

}  // namespace

bool IsOutput(CLI::Option* option) { return HasMark(option, kFileMark) || HasMark(option, kPlaceMark); }

void CheckPlaces(const Registry::Entry& entry) {
  if (entry.name == "models list") return;  // only reads there
  for (CLI::Option* option : entry.app->get_options([](const CLI::Option*) { return true; })) {
    if (option->count() == 0 || option->get_positional()) continue;  // what is there already its command knows
    const bool file = HasMark(option, kFileMark);
    const auto path = file || HasMark(option, kPlaceMark) ? option->as<std::string>() : std::string();
    if (path.empty()) continue;
    const bool stem = option->get_name() == "--video";  // of several files, with the cameras' names
    file && !stem ? CheckFile(path) : RequireRoomIn(stem ? std::filesystem::path(path).parent_path().string() : path);
  }
}

}  // namespace mvstudio::cli
