#include "stages/calib/earlier_world.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/disk/files.h"
#include "geometry/rig/rig_io.h"
#include "stages/input/fingerprint.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;
namespace fs = std::filesystem;
using Kind = geometry::RigGauge::Kind;

ordered_json Parsed(const std::string& text) { return ordered_json::parse(text, nullptr, false); }

/// The inputs of the last run of `calibrate` that wrote a calibration into the folder.
ordered_json EarlierInputs(const std::string& folder) {
  const std::string path = folder + "/provenance.jsonl";
  ordered_json inputs = ordered_json::array();
  if (!fs::is_regular_file(path)) return inputs;
  std::istringstream lines(ReadFile(path));
  for (std::string text; std::getline(lines, text);) {
    const ordered_json line = Parsed(text);
    if (!line.is_object() || line.value("command", ordered_json()) != "calibrate") continue;
    const ordered_json outputs = line.value("outputs", ordered_json());
    if (outputs.is_array() && !outputs.empty()) inputs = line.value("inputs", ordered_json::array());
  }
  return inputs;
}

/// Whether every footage was an input of that run, wherever it lay.
bool SameFootage(const std::string& folder, const std::vector<std::string>& footage) {
  ordered_json earlier = EarlierInputs(folder);
  if (!earlier.is_array()) return false;
  for (ordered_json& input : earlier) {
    if (input.is_object()) input.erase("path");
  }
  return std::all_of(footage.begin(), footage.end(), [&](const std::string& path) {
    ordered_json now = FingerprintJson(path);
    now.erase("path");
    return std::find(earlier.begin(), earlier.end(), now) != earlier.end();
  });
}

/// How frames were paired then; empty: not known.
std::string EarlierPairing(const std::string& folder) {
  const std::string path = folder + "/calibrate.result.json";
  if (!fs::is_regular_file(path)) return "";
  const ordered_json json = Parsed(ReadFile(path));
  const ordered_json::json_pointer place("/metrics/pairing/by");
  return json.is_object() && json.contains(place) && json[place].is_string() ? json[place].get<std::string>() : "";
}

/// Nothing where there is no world worth keeping.
std::optional<geometry::RigGauge> EarlierGauge(const std::string& folder) {
  const std::string path = folder + "/calibration.json";
  if (!fs::is_regular_file(path)) return std::nullopt;
  try {
    const geometry::RigGauge gauge = geometry::ReadRig(path).gauge;
    const bool lost = gauge.kind == Kind::kCamera || gauge.kind == Kind::kLensesOnly || GaugeText(gauge).empty();
    return lost ? std::nullopt : std::optional(gauge);
  } catch (const std::exception&) {  // damaged: what it said is not known, and it is replaced
    return std::nullopt;
  }
}

std::string WhyLost(const geometry::RigGauge& gauge, const std::string& folder, const CornerArguments& arguments,
                    const CornerInput& corners) {
  if (!gauge.frame || gauge != geometry::RigGauge::OfBoard(*gauge.frame)) return "that was done after a calibration";
  if (!SameFootage(folder, CornerPaths(arguments))) return "the board was filmed again";
  if (EarlierPairing(folder) != (arguments.timeline ? "time" : "number")) return "frames are paired in another way now";
  const auto& boards = corners.input.detections;
  const auto there = [&](const calib::Detection& board) { return board.frame_idx == gauge.frame && board.board_idx == 0; };
  return std::any_of(boards.begin(), boards.end(), there) ? "" : "no board was found in that frame now";
}

}  // namespace

std::optional<EarlierWorld> FindEarlierWorld(const std::string& folder, const CornerArguments& arguments,
                                             const CornerInput& corners) {
  const std::optional<geometry::RigGauge> gauge = EarlierGauge(folder);
  if (!gauge) return std::nullopt;
  return EarlierWorld{*gauge, WhyLost(*gauge, folder, arguments, corners)};
}

}  // namespace mvstudio::stages
