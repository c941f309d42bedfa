#include "stages/dataset_build/mask_warnings.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"

namespace mvstudio::stages {

std::vector<Notice> MaskWarnings(const std::string& masks) {
  std::vector<Notice> notices;
  const std::string path = masks + "/mask.result.json";
  if (!std::filesystem::exists(path)) return notices;
  const auto made = nlohmann::json::parse(ReadFile(path), nullptr, false);
  if (!made.is_object() || !made.contains("warnings") || !made["warnings"].is_array()) return notices;
  for (const auto& warning : made["warnings"]) {
    const auto word = [&](const char* key) {
      const auto at = warning.is_object() ? warning.find(key) : warning.end();
      return at != warning.end() && at->is_string() ? at->get<std::string>() : "";
    };
    const std::string code = word("code");
    if (code == "MSK-HULL" || code == "MSK-JOINTS" || code == "MSK-EMPTY")
      notices.push_back({code, "of the masks in " + masks + ": " + word("text"), word("hint")});
  }
  return notices;
}

}  // namespace mvstudio::stages
