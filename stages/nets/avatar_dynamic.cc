#include "stages/nets/avatar_dynamic.h"

#include "core/format.h"

namespace mvstudio::stages {
namespace {

using Json = nlohmann::ordered_json;

Json CandidateJson(const body::DynamicCandidate& candidate) {
  Json blocks = Json::array();
  for (const body::BlockGain& gain : candidate.gains) {
    blocks.push_back({{"name", gain.name},
                      {"loss", FiniteOrNull(gain.loss)},
                      {"gain", FiniteOrNull(gain.gain.mean)},
                      {"standard_error", FiniteOrNull(gain.gain.standard_error)},
                      {"beats", gain.beats}});
  }
  return {{"name", candidate.name},       {"mean_gain", FiniteOrNull(candidate.mean_gain)},
          {"beats", candidate.beats},     {"kept", candidate.kept},
          {"seconds", candidate.seconds}, {"blocks", blocks}};
}

}  // namespace

Json ToJson(const body::DynamicFit& fit) {
  if (fit.reason.empty()) return nullptr;
  Json candidates = Json::array();
  for (const body::DynamicCandidate& candidate : fit.candidates) candidates.push_back(CandidateJson(candidate));
  return {{"kept", fit.offsets.has_value()},
          {"reason", fit.reason},
          {"network", fit.offsets && fit.offsets->network},
          {"components", fit.offsets && fit.offsets->linear ? fit.offsets->linear->basis.size() : 0},
          {"rms_mm", 1e3 * fit.rms_m},
          {"most_mm", 1e3 * fit.most_m},
          {"candidates", candidates}};
}

std::string ToTable(const body::DynamicFit& fit) {
  if (fit.reason.empty()) return "";
  std::string text = "\nsurface that moves with the pose      mean gain of IoU in blocks left out   seconds\n";
  for (const body::DynamicCandidate& candidate : fit.candidates) {
    text += Format("%-36s%+12.4f %26s%10.1f%s\n", candidate.name.c_str(), candidate.mean_gain,
                   candidate.beats ? "in every block" : "", candidate.seconds, candidate.kept ? "  kept" : "");
  }
  text += fit.reason + "\n";
  if (fit.offsets) {
    const std::string kind = fit.offsets->network
                                 ? "a network"
                                 : Format("%d components of the poses", static_cast<int>(fit.offsets->linear->basis.size()));
    text += Format("offsets: %s, %.1f mm rms, %.1f mm at most\n", kind.c_str(), 1e3 * fit.rms_m, 1e3 * fit.most_m);
  }
  return text;
}

}  // namespace mvstudio::stages
