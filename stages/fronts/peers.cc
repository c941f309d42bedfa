#include "stages/fronts/peers.h"

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/process.h"
#include "stages/result.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

double NumberOf(const ordered_json& json, const char* key) {
  return json.contains(key) && json[key].is_number() ? json[key].get<double>() : NAN;
}

std::string TextOf(const ordered_json& json, const char* key) {
  return json.contains(key) && json[key].is_string() ? json[key].get<std::string>() : "";
}

FrontWay PeerWay(const ordered_json& json) {
  FrontWay way;
  way.mark = WayMark::kPeer;
  way.name = TextOf(json, "name"), way.command = TextOf(json, "command"), way.why_not = TextOf(json, "why_not");
  way.seconds = NumberOf(json, "seconds"), way.cpu_s = NumberOf(json, "processor_seconds");
  way.peak_rss_mb = NumberOf(json, "peak_rss_mb"), way.error = NumberOf(json, "error");
  if (way.why_not.empty() && !std::isfinite(way.error)) way.why_not = "it gave no error";
  return way;
}

FrontWay FailedPeers(const std::string& program, const std::string& why) {
  FrontWay way;
  way.name = program, way.mark = WayMark::kPeer, way.why_not = why;
  return way;
}

/// A traceback says at its end what happened.
std::string LastLine(const std::string& text) {
  const size_t end = text.find_last_not_of(" \r\n");
  if (end == std::string::npos) return "";
  const size_t before = text.rfind('\n', end);
  const size_t begin = before == std::string::npos ? 0 : before + 1;
  return text.substr(begin, end + 1 - begin);
}

}  // namespace

std::vector<FrontWay> PeerWays(const std::string& program, const std::string& stage, const FrontsMaterial& material) {
  const LentFolder lent(material.runs + "/peers-" + stage);  // what peers leave in it is theirs, and goes with it
  const std::string &folder = lent.path(), out = folder + "/ways.json", said = folder + "/said.txt";
  int exit = 0;
  try {
    exit = RunProcess({program, stage, "session=" + material.session, "take=" + material.take, "calib=" + material.calibration,
                       "out=" + folder, "threads=" + std::to_string(material.threads)},
                      {out, said});
  } catch (const IoError& error) {
    return {FailedPeers(program, error.what())};
  }
  if (exit != 0) {
    const std::string line = LastLine(ReadFile(said));
    return {FailedPeers(program, "it ended with " + std::to_string(exit) + (line.empty() ? "" : ": " + line))};
  }
  const ordered_json json = ordered_json::parse(ReadFile(out), nullptr, false);
  if (!json.is_array()) return {FailedPeers(program, "it printed no JSON list")};
  std::vector<FrontWay> ways;
  for (const ordered_json& way : json) ways.push_back(PeerWay(way));
  return ways;
}

}  // namespace mvstudio::stages
