#include "dataset/time/motion_sync.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>

#include "core/error.h"
#include "core/fields.h"
#include "dataset/footage/frames.h"

namespace mvstudio::dataset {
namespace {

constexpr ChoiceWords<MotionSyncStatus, 4> kMotionStatuses = {{{MotionSyncStatus::kOk, "Ok"},
                                                               {MotionSyncStatus::kNoMotion, "NoMotion"},
                                                               {MotionSyncStatus::kTooShort, "TooShort"},
                                                               {MotionSyncStatus::kAmbiguous, "Ambiguous"}}};

constexpr double kLeastSpread = 0.15;  // standard deviation of log energy below which offsets cannot be distinguished
constexpr double kClearPeak = 0.85;    // the runner-up must stay below this share of the peak
constexpr int kPeakReach = 6;          // frames around the peak that belong to it
constexpr int kBlocks = 8;

double MeanChange(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(int{a.pixels[i]} - int{b.pixels[i]});
  return sum / static_cast<double>(std::max<size_t>(a.pixels.size(), 1));
}

/// Log energy without its mean; NaN where there is none.
std::vector<double> Signal(const std::vector<double>& energy) {
  std::vector<double> signal;
  double sum = 0;
  int count = 0;
  for (const double e : energy) {
    signal.push_back(std::isfinite(e) ? std::log(e + 0.02) : std::nan(""));
    if (std::isfinite(e)) sum += signal.back(), ++count;
  }
  for (double& s : signal) s -= sum / std::max(count, 1);
  return signal;
}

double Spread(const std::vector<double>& signal) {
  double squares = 0;
  int count = 0;
  for (const double s : signal) {
    if (std::isfinite(s)) squares += s * s, ++count;
  }
  return count > 1 ? std::sqrt(squares / (count - 1)) : 0;
}

/// Correlation of a[n] with b[n + lag], over n outside [skip_from, skip_to); NaN for too little overlap.
double Correlation(const std::vector<double>& a, const std::vector<double>& b, int lag, int least, int skip_from = 0,
                   int skip_to = 0) {
  double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  int count = 0;
  const int end = std::min(static_cast<int>(a.size()), static_cast<int>(b.size()) - lag);
  for (int n = std::max(0, -lag); n < end; ++n) {
    const double x = a[static_cast<size_t>(n)], y = b[static_cast<size_t>(n + lag)];
    if ((n >= skip_from && n < skip_to) || !std::isfinite(x) || !std::isfinite(y)) continue;
    sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y, ++count;
  }
  if (count < least) return std::nan("");
  const double va = saa - sa * sa / count, vb = sbb - sb * sb / count;
  return va > 1e-9 && vb > 1e-9 ? (sab - sa * sb / count) / std::sqrt(va * vb) : std::nan("");
}

struct Pair {
  bool tells = false;
  double lag = 0, sigma = 0, peak = 0, runner_up = 0, score = 0;
};

int BestLag(const std::function<double(int)>& correlation, int reach, double* best) {
  int lag = 0;
  *best = -2;
  for (int k = -reach; k <= reach; ++k) {
    const double r = correlation(k);
    if (r > *best) *best = r, lag = k;
  }
  return lag;
}

/// Top of the parabola through three neighbours.
double Refine(double before, double at, double after) {
  const double curve = before - 2 * at + after;
  return curve < 0 && std::isfinite(curve) ? std::clamp(0.5 * (before - after) / curve, -0.5, 0.5) : 0;
}

/// Standard deviation of a correlation of unrelated signals with these autocorrelations (Bartlett 1946).
double ChanceDeviation(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 1;
  for (int k = 1; k < 40; ++k) {
    const double ra = Correlation(a, a, k, 10), rb = Correlation(b, b, k, 10);
    if (!(ra > 0.05) || !(rb > 0.05)) break;
    sum += 2 * ra * rb;
  }
  return std::sqrt(sum / static_cast<double>(std::max<size_t>(std::min(a.size(), b.size()), 1)));
}

Pair Compare(const std::vector<double>& a, const std::vector<double>& b, const MotionSyncOptions& options) {
  Pair pair;
  const int reach = options.max_offset_frames, least = options.min_overlap_frames;
  const int lag = BestLag([&](int k) { return Correlation(a, b, k, least); }, reach, &pair.peak);
  if (pair.peak <= 0) return pair;
  const auto at = [&](int k) { return Correlation(a, b, k, least); };
  pair.lag = lag + Refine(at(lag - 1), pair.peak, at(lag + 1));
  for (int k = -reach; k <= reach; ++k) {
    if (std::abs(k - lag) > kPeakReach) pair.runner_up = std::max(pair.runner_up, std::isfinite(at(k)) ? at(k) : 0);
  }
  double squares = 0;
  const int size = static_cast<int>(a.size());
  for (int block = 0; block < kBlocks; ++block) {  // jackknife
    const int from = size * block / kBlocks, to = size * (block + 1) / kBlocks;
    const auto without = [&](int k) { return Correlation(a, b, k, least / 2, from, to); };
    double best = 0;
    const int own = BestLag(without, reach, &best);
    const double top = own + Refine(without(own - 1), best, without(own + 1));
    squares += (top - pair.lag) * (top - pair.lag) * (kBlocks - 1) / kBlocks;
  }
  pair.sigma = std::max(std::sqrt(squares), 0.5);
  const double chance = ChanceDeviation(a, b) * (std::sqrt(2 * std::log(2.0 * reach + 1)) + 3);
  pair.score = pair.peak - std::max(pair.runner_up, chance);
  pair.tells = pair.peak > chance && pair.runner_up < kClearPeak * pair.peak && pair.sigma < 0.5 * kPeakReach;
  return pair;
}

struct Network {
  size_t size = 0;
  std::vector<Pair> pairs;  // (size, size); lag of the second against the first
  Pair& At(size_t i, size_t j) { return pairs[i * size + j]; }
};

Network ComparePairs(const std::vector<std::vector<double>>& signals, const MotionSyncOptions& options) {
  Network net{signals.size(), std::vector<Pair>(signals.size() * signals.size())};
  for (size_t i = 0; i < net.size; ++i) {
    for (size_t j = i + 1; j < net.size; ++j) {
      net.At(i, j) = net.At(j, i) = Compare(signals[i], signals[j], options);
      net.At(j, i).lag = -net.At(i, j).lag;
    }
  }
  return net;
}

size_t Reference(Network* net, const std::vector<MotionEnergy>& cameras, const std::string& name) {
  size_t best = 0;
  double best_score = -1e9;
  for (size_t i = 0; i < net->size; ++i) {
    if (cameras[i].camera == name) return i;
    double score = 0;
    for (size_t j = 0; j < net->size; ++j) score += i != j && net->At(i, j).tells ? net->At(i, j).score : 0;
    if (score > best_score) best = i, best_score = score;
  }
  if (!name.empty()) throw UsageError("option 'reference' " + name + ": no such camera has footage");
  return best;
}

/// Prim's tree of the clearest pairs, from the reference on.
void SumAlongTree(Network* net, size_t reference, std::vector<MotionSyncCamera>* cameras) {
  std::vector<bool> done(net->size, false);
  done[reference] = true;
  (*cameras)[reference].status = MotionSyncStatus::kOk;
  (*cameras)[reference].correlation = 1;
  while (true) {
    const Pair* best = nullptr;
    size_t from = 0, to = 0;
    for (size_t i = 0; i < net->size; ++i) {
      for (size_t j = 0; j < net->size; ++j) {
        const Pair& pair = net->At(i, j);
        if (done[i] && !done[j] && pair.tells && (!best || pair.score > best->score)) best = &pair, from = i, to = j;
      }
    }
    if (!best) return;
    MotionSyncCamera& camera = (*cameras)[to];
    const MotionSyncCamera& base = (*cameras)[from];
    camera.status = MotionSyncStatus::kOk;
    camera.offset_frames = base.offset_frames + best->lag;
    camera.sigma_frames = std::hypot(base.sigma_frames, best->sigma);
    camera.correlation = best->peak, camera.runner_up = best->runner_up;
    done[to] = true;
  }
}

}  // namespace

std::string_view ToString(MotionSyncStatus status) { return WordOf(kMotionStatuses, status); }

MotionEnergy ReadMotionEnergy(const CameraTimes& times) {
  constexpr int kSide = 96;
  const std::vector<std::pair<int64_t, int64_t>> ticks = TicksOfFrames(times);
  MotionEnergy motion{times.camera, {}};
  const auto source = OpenFrames(times.source);
  Image before;
  int64_t last = -2;
  for (auto at = ticks.begin(); auto frame = source->Advance();) {
    while (at != ticks.end() && at->first < frame->number) ++at;
    if (at == ticks.end() || at->first != frame->number) continue;
    Image now = source->Thumbnail(kSide);
    if (at->second > 10'000'000) break;
    if (at->second >= static_cast<int64_t>(motion.energy.size()))
      motion.energy.resize(static_cast<size_t>(at->second) + 1, std::nan(""));
    if (at->second == last + 1) motion.energy[static_cast<size_t>(at->second)] = MeanChange(before, now);
    last = at->second;
    before = std::move(now);
  }
  return motion;
}

MotionSync SynchronizeByMotion(const std::vector<MotionEnergy>& cameras, const MotionSyncOptions& options) {
  if (cameras.size() < 2) throw UsageError("offsets need at least two cameras");
  MotionSync sync;
  std::vector<std::vector<double>> signals;
  for (const MotionEnergy& c : cameras) {
    MotionSyncCamera& camera = sync.cameras.emplace_back();
    camera.name = c.camera;
    signals.push_back(Signal(c.energy));
    if (Spread(signals.back()) < kLeastSpread) camera.status = MotionSyncStatus::kNoMotion;
    if (static_cast<int>(c.energy.size()) < options.min_overlap_frames) camera.status = MotionSyncStatus::kTooShort;
    if (camera.status != MotionSyncStatus::kAmbiguous) signals.back().clear();
  }
  Network net = ComparePairs(signals, options);
  const size_t reference = Reference(&net, cameras, options.reference);
  sync.reference = cameras[reference].camera;
  if (sync.cameras[reference].status == MotionSyncStatus::kAmbiguous) SumAlongTree(&net, reference, &sync.cameras);
  return sync;
}

SyncFile ToSyncFile(const MotionSync& sync) {
  SyncFile file;
  file.reference = sync.reference;
  for (const MotionSyncCamera& c : sync.cameras) {
    SyncedCamera& entry = file.cameras.emplace_back();
    entry.name = c.name;
    entry.status = ToString(c.status);
    if (c.status != MotionSyncStatus::kOk) continue;
    entry.offset_frames = c.offset_frames;
    entry.sigma_frames = c.sigma_frames;
  }
  return file;
}

}  // namespace mvstudio::dataset
