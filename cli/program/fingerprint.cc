#include "cli/program/fingerprint.h"

#include "stages/fingerprint.h"

namespace mvstudio::cli {

nlohmann::ordered_json Fingerprint(const std::string& path) {
  const stages::Fingerprint print = stages::FingerprintOf(path);
  nlohmann::ordered_json item = {{"path", print.path}, {"files", print.files}, {"bytes", print.bytes}};
  if (!print.error.empty()) item["error"] = print.error;
  if (!print.sha256.empty()) item[print.files == 1 ? "sha256" : "sha256_of_list"] = print.sha256;
  return item;
}

}  // namespace mvstudio::cli
