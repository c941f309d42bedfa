#include "dataset/json/json_file.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/json_view.h"
#include "core/label.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMaxDepth = 64;

}  // namespace

Json ParseJson(std::string_view text, const std::string& path, bool missing_as_null) {
  return JsonFromText<Json>(text, {kMaxDepth, true, missing_as_null}, path);
}

std::string ReadTextFile(const std::string& path, int64_t max_bytes) {
  std::error_code error;
  RequireRegularFile(path);
  const auto size = fs::file_size(path, error);
  if (!error && size > static_cast<uintmax_t>(max_bytes)) {
    throw FormatError(path, "",
                      "has " + std::to_string(size >> 20) + " MiB, such a file has at most " + std::to_string(max_bytes >> 20));
  }
  return ReadFile(path);
}

Json ParseJsonFile(const std::string& path, int64_t max_bytes) { return ParseJson(ReadTextFile(path, max_bytes), path); }

std::string CameraName(const JsonView& json) {
  const std::string name = json.Text(), why = WhyNotALabel(name);
  if (!why.empty()) json.Fail(Quoted(name) + " " + why + ": it cannot be a camera's name");
  return name;
}

std::string NumberText(double value) { return Json(value).dump(); }

std::string StreamNumberText(double value) {
  char text[40];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

std::string Quoted(const std::string& text) { return JsonQuoted<Json>(text); }

}  // namespace mvstudio::dataset::internal
