#include "dataset/json/json_file.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/json_tree.h"
#include "core/label.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

constexpr size_t kMaxDepth = 64;

[[noreturn]] void Refuse(const JsonProblem& problem, const std::string& path) {
  const std::string place = "byte " + std::to_string(problem.byte);
  switch (problem.kind) {
    case JsonProblem::Kind::kDepth:
      throw FormatError(path, "", "is nested deeper than " + std::to_string(kMaxDepth) + " levels");
    case JsonProblem::Kind::kTwice:
      throw FormatError(path, problem.where, "the key " + Quoted(problem.key) + " is there twice");
    case JsonProblem::Kind::kNumber:
      throw FormatError(path, place, "the number is beyond the range of doubles");
    default:
      throw FormatError(path, place, "is not valid JSON; cut short or damaged?");
  }
}

}  // namespace

Json ParseJson(std::string_view text, const std::string& path) {
  Json json;
  const JsonProblem problem = ParseJsonTree(text, {kMaxDepth, true}, &json);
  if (problem.kind != JsonProblem::Kind::kNone) Refuse(problem, path);
  return json;
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

std::string Quoted(const std::string& text) {
  constexpr size_t kMaxBytes = 60;
  const std::string shown = Json(text.substr(0, kMaxBytes)).dump(-1, ' ', true, Json::error_handler_t::replace);
  return "'" + shown.substr(1, shown.size() - 2) + (text.size() > kMaxBytes ? "…" : "") + "'";
}

}  // namespace mvstudio::dataset::internal
