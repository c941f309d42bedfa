#include "dataset/time/timeline.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include "core/error.h"
#include "core/random.h"
#include "dataset/session/session_scan.h"
#include "dataset/session/timeline_source.h"
#include "tests/dataset/clip_writer.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;

/// A camera as it was: its clock, and which ticks it kept.
struct Filmed {
  CameraTimes times;
  double start_s = 0, period_s = 0;
  std::vector<int64_t> tick;  ///< of each frame

  double TrueTime(size_t k) const { return start_s + period_s * static_cast<double>(tick[k]); }
};

struct Faults {
  double drop = 0;     ///< share of ticks
  double doubled = 0;  ///< share of frames that are there twice, with one time stamp
  double jitter_s = 0;
  double quantum_s = 0;
};

Filmed Film(const std::string& name, double start_s, double period_s, int ticks, const Faults& faults, uint64_t seed) {
  Filmed filmed;
  filmed.times.camera = name;
  filmed.start_s = start_s, filmed.period_s = period_s;
  Rng rng(seed);
  const auto add = [&](int64_t tick, double time_s) {
    filmed.times.frame.push_back(static_cast<int64_t>(filmed.times.frame.size()));
    filmed.times.time_s.push_back(faults.quantum_s > 0 ? faults.quantum_s * std::round(time_s / faults.quantum_s) : time_s);
    filmed.tick.push_back(tick);
  };
  for (int n = 0; n < ticks; ++n) {
    const bool inside = n > 0 && n + 1 < ticks;
    if (inside && rng.Uniform() < faults.drop) {
      if (rng.Uniform() < 0.2) n += static_cast<int>(rng.Index(60));  // now and then a long gap
      if (n + 1 < ticks) continue;
    }
    const double time_s = start_s + period_s * n + faults.jitter_s * std::clamp(rng.Normal(), -3.0, 3.0);
    add(n, time_s);
    if (inside && rng.Uniform() < faults.doubled) add(n, time_s);
  }
  return filmed;
}

/// Time steps whose frame is the true one: the first kept frame of the tick nearest to the time step, or none when that tick
/// was not kept. Ticks that are equally near to a hundredth of a frame are both right.
int CountRight(const Timeline& timeline, const Filmed& reference, const Filmed& filmed) {
  const CameraTimeline* camera = timeline.Find(filmed.times.camera);
  int right = 0;
  for (int64_t i = 0; i < timeline.num_time_steps; ++i) {
    const double step_time_s = reference.start_s + reference.period_s * static_cast<double>(i);
    const double exact = (step_time_s - filmed.start_s) / filmed.period_s;
    std::set<int64_t> allowed;
    for (const double shift : {-0.01, 0.01}) {
      const auto tick = static_cast<int64_t>(std::floor(exact + 0.5 + shift));
      const auto at = std::find(filmed.tick.begin(), filmed.tick.end(), tick);
      allowed.insert(at == filmed.tick.end() ? -1 : filmed.times.frame[static_cast<size_t>(at - filmed.tick.begin())]);
    }
    right += allowed.count(camera->frame_at[static_cast<size_t>(i)]) > 0;
  }
  return right;
}

int64_t TrueDrops(const Filmed& filmed) {
  int64_t drops = 0;
  for (size_t k = 1; k < filmed.tick.size(); ++k) drops += std::max<int64_t>(filmed.tick[k] - filmed.tick[k - 1] - 1, 0);
  return drops;
}

int64_t FoundDrops(const CameraTimeline& camera) {
  int64_t drops = 0;
  for (const DroppedFrames& d : camera.dropped) drops += d.count;
  return drops;
}

void ExpectAllRight(const char* what, const Timeline& timeline, const std::vector<Filmed>& cameras) {
  for (const Filmed& filmed : cameras) {
    const CameraTimeline& camera = *timeline.Find(filmed.times.camera);
    const int right = CountRight(timeline, cameras[0], filmed);
    std::printf("%-28s %s: %d of %d instants right; drops %d of %d; residual median %.3f, max %.3f ms\n", what,
                camera.name.c_str(), right, static_cast<int>(timeline.num_time_steps), static_cast<int>(FoundDrops(camera)),
                static_cast<int>(TrueDrops(filmed)), camera.residual_median_ms, camera.residual_max_ms);
    EXPECT_EQ(right, timeline.num_time_steps) << what << " " << camera.name;
    EXPECT_EQ(FoundDrops(camera), TrueDrops(filmed)) << what << " " << camera.name;
  }
}

std::vector<CameraTimes> TimesOf(const std::vector<Filmed>& cameras) {
  std::vector<CameraTimes> times;
  for (const Filmed& filmed : cameras) times.push_back(filmed.times);
  return times;
}

constexpr double kPeriod = 1 / 29.97;

TEST(Timeline, DropsDoublesDriftAndAFractionOfAFrame) {
  const Faults faults{0.02, 0.01, 0.0005, 0};
  const double t0 = 1.7e9;  // seconds since 1970
  const std::vector<Filmed> cameras = {Film("a", t0, kPeriod, 4000, faults, 1),
                                       Film("b", t0 - 0.37 * kPeriod, kPeriod * (1 + 50e-6), 4000, faults, 2),
                                       Film("c", t0 + 12.2 * kPeriod, kPeriod * (1 - 30e-6), 3900, faults, 3)};
  const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr);
  ExpectAllRight("50 ppm, 0.37 frame", timeline, cameras);
  const CameraTimeline &b = *timeline.Find("b"), &c = *timeline.Find("c");
  EXPECT_NEAR(b.rate_ppm, 50, 5 * b.rate_sigma_ppm);
  EXPECT_NEAR(c.rate_ppm, -30, 5 * c.rate_sigma_ppm);
  EXPECT_LT(b.rate_sigma_ppm, 1);
  EXPECT_NEAR(b.offset_frames, 0.37, 5 * b.sigma_frames);
  EXPECT_NEAR(c.offset_frames, -12.2, 5 * c.sigma_frames);
  EXPECT_LT(b.sigma_frames, 0.002);
  for (const CameraTimeline& camera : timeline.cameras) EXPECT_GT(camera.doubled.size(), 15u);
}

TEST(Timeline, PredictedSigmasAreThoseOfManyDraws) {
  double offset = 0, rate = 0;
  constexpr int kDraws = 60;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Faults faults{0, 0, 0.002, 0};
    const std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 300, faults, 100 + draw),
                                         Film("b", 0.25 * kPeriod, kPeriod * (1 + 50e-6), 300, faults, 500 + draw)};
    const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr);
    const CameraTimeline& b = timeline.cameras[1];
    offset += std::pow((b.offset_frames + 0.25) / b.sigma_frames, 2) / kDraws;
    rate += std::pow((b.rate_ppm - 50) / b.rate_sigma_ppm, 2) / kDraws;
  }
  EXPECT_NEAR(std::sqrt(offset), 1, 0.25);
  EXPECT_NEAR(std::sqrt(rate), 1, 0.25);
}

TEST(Timeline, DifferentFrameRates) {
  const Faults faults{0.01, 0, 0.0002, 0};
  const std::vector<Filmed> cameras = {Film("hd", 5, 1 / 29.97, 3000, faults, 4), Film("vga", 5.013, 1 / 25.0, 2500, faults, 5),
                                       Film("fast", 4.99, 1 / 120.0, 12000, faults, 6)};
  const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr);
  ExpectAllRight("29.97, 25 and 120 Hz", timeline, cameras);
  EXPECT_LE(timeline.Find("vga")->residual_max_ms, 21);
  EXPECT_LE(timeline.Find("fast")->residual_max_ms, 5.2);
  EXPECT_LT(std::abs(timeline.Find("vga")->rate_ppm), 5);
  const SyncedCamera vga = SyncFromTimeline(timeline).cameras[1];
  EXPECT_EQ(vga.status, "Ok");
  EXPECT_NEAR(vga.nominal_rate / (1 + 1e-6 * vga.rate_ppm), 25 / 29.97, 1e-6);
  TimelineOptions near;
  near.max_residual_ms = 5;
  const Timeline strict = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr, near);
  EXPECT_LE(strict.Find("vga")->residual_max_ms, 5);
  EXPECT_LT(TimeStepsOfFrames(*strict.Find("vga")).size(), TimeStepsOfFrames(*timeline.Find("vga")).size() / 2);
}

TEST(Timeline, EachFrameHasOneTimeStep) {
  const std::vector<Filmed> cameras = {Film("fast", 5, 1 / 60.0, 600, {0, 0, 0, 0}, 1),
                                       Film("slow", 5.005, 1 / 30.0, 300, {0, 0, 0, 0}, 2)};
  Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr);
  CameraTimeline& slow = timeline.cameras[1];
  EXPECT_GT(TimeStepsOfFrames(slow).size(), 550u);  // two a frame
  const std::map<int64_t, int64_t> nearest = TimeStepOfEachFrame(slow);
  EXPECT_GT(nearest.size(), 290u);
  for (const auto& [frame, time_step] : nearest) EXPECT_EQ(time_step, 2 * frame) << "0.3 of a step late, so not the step after";
  slow.residual_s.clear();  // as from a file
  for (const auto& [frame, time_step] : TimeStepOfEachFrame(slow)) EXPECT_LE(std::abs(time_step - 2 * frame), 1) << frame;
  EXPECT_EQ(TimeStepOfEachFrame(timeline.cameras[0]).at(7), 7);
}

TEST(Timeline, MillisecondStampsAndLongGaps) {
  const Faults faults{0.01, 0, 0, 0.001};
  const std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 20000, faults, 7),
                                       Film("b", 0.2 * kPeriod, kPeriod * (1 - 20e-6), 20000, faults, 8)};
  ExpectAllRight("milliseconds", BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr), cameras);
}

TEST(Timeline, OffsetsFromASyncFile) {
  const Faults faults{0.02, 0.01, 0, 1.0 / 90000};
  std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 2000, faults, 9), Film("b", 0, kPeriod, 2000, faults, 10)};
  SyncFile sync{"a", 29.97, {{"a", "Ok", 0.0, 0}, {"b", "Ok", -7.37, 0.02}}};
  const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kOffsets, &sync);
  cameras[1].start_s = 7.37 * kPeriod;  // its frame -7.37 is the reference's frame 0
  ExpectAllRight("sync file", timeline, cameras);
  EXPECT_NEAR(timeline.Find("b")->offset_frames, -7.37, 1e-3);
  sync.cameras[1] = {"b", "NoMotion", std::nullopt, 0};
  const Timeline without = BuildTimeline(TimesOf(cameras), TimelineClock::kOffsets, &sync);
  EXPECT_EQ(without.Find("b")->status, ClockStatus::kNoOffset);
  EXPECT_TRUE(TimeStepsOfFrames(*without.Find("b")).empty());
}

TEST(Timeline, DriftThatASyncFileStates) {
  const Faults none;
  std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 30000, none, 1), Film("b", 0, kPeriod, 30000, none, 1)};
  SyncFile sync{"a", 29.97, {{"a", "Ok", 0.0, 0}, {"b", "Ok", 0.1, 0, 1, 50}}};
  const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kOffsets, &sync);
  cameras[1].start_s = -0.1 * kPeriod, cameras[1].period_s = kPeriod * (1 + 50e-6);
  ExpectAllRight("sync file with drift", timeline, cameras);
}

TEST(Timeline, TimeStampsThatLie) {
  std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 500, {}, 1), Film("b", 0, kPeriod, 500, {}, 1)};
  std::vector<double>& t = cameras[1].times.time_s;
  t[40] = 1e6, t[41] = -5, t[77] = std::nan(""), t[78] = std::nan(""), t[200] = t[199] - 0.5, t[300] = INFINITY;
  const Timeline timeline = BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr);
  ExpectAllRight("lying time stamps", timeline, cameras);
  EXPECT_EQ(timeline.Find("b")->bad_times, (std::vector<int64_t>{40, 41, 77, 78, 200, 300}));
}

TEST(Timeline, AFrameThatComesLateIsNotADropAndADouble) {
  std::vector<Filmed> cameras = {Film("a", 0, kPeriod, 300, {}, 1), Film("b", 0, kPeriod, 300, {}, 1)};
  for (const size_t k : {50u, 120u, 121u + 80u}) cameras[1].times.time_s[k] += 0.6 * kPeriod;
  ExpectAllRight("late frames", BuildTimeline(TimesOf(cameras), TimelineClock::kCommon, nullptr), cameras);
}

TEST(Timeline, AClockThatWandersByMoreThanAFrame) {
  std::vector<CameraTimes> cameras = {Film("a", 0, kPeriod, 12000, {}, 1).times, {"b", "", {}, {}, {}, std::nullopt}};
  const auto time_of = [](int64_t tick) {  // 1.5 frames to and fro, with the temperature of the room
    const double n = static_cast<double>(tick);
    return kPeriod * (n + 0.2 + 1.5 * std::sin(2 * M_PI * n / 9000));
  };
  std::vector<int64_t> frame_of(12000, -1);
  Rng rng(5);
  for (int64_t tick = 0; tick < 12000; ++tick) {
    if (tick > 0 && rng.Uniform() < 0.02) continue;
    frame_of[static_cast<size_t>(tick)] = static_cast<int64_t>(cameras[1].frame.size());
    cameras[1].frame.push_back(frame_of[static_cast<size_t>(tick)]);
    cameras[1].time_s.push_back(time_of(tick));
  }
  const Timeline timeline = BuildTimeline(cameras, TimelineClock::kCommon, nullptr);
  int right = 0, compared = 0;
  for (int64_t i = 5; i + 5 < timeline.num_time_steps; ++i, ++compared) {
    int64_t nearest = i - 4;
    for (int64_t tick = i - 4; tick <= std::min<int64_t>(i + 4, 11999); ++tick) {
      const double step_time_s = kPeriod * static_cast<double>(i);
      if (std::abs(time_of(tick) - step_time_s) < std::abs(time_of(nearest) - step_time_s)) nearest = tick;
    }
    right += timeline.cameras[1].frame_at[static_cast<size_t>(i)] == frame_of[static_cast<size_t>(nearest)];
  }
  std::printf("wandering clock: %d of %d instants right\n", right, compared);
  EXPECT_EQ(right, compared);
}

TEST(Timeline, ClocksThatAreNone) {
  std::vector<CameraTimes> cameras =
      TimesOf({Film("a", 0, kPeriod, 200, {}, 1), Film("b", 0, kPeriod, 200, {}, 2), Film("c", 0, kPeriod, 200, {}, 3)});
  Rng rng(3);
  for (size_t k = 1; k < 200; ++k) cameras[1].time_s[k] = cameras[1].time_s[k - 1] + kPeriod * (0.5 + rng.Uniform());
  for (double& t : cameras[2].time_s) t = std::nan("");
  const Timeline timeline = BuildTimeline(cameras, TimelineClock::kCommon, nullptr);
  const CameraTimeline &b = timeline.cameras[1], &c = timeline.cameras[2];
  EXPECT_EQ(b.status, ClockStatus::kVariable);
  for (size_t i = 0; i < b.frame_at.size(); ++i) {  // the nearest in time
    if (b.frame_at[i] < 0) continue;
    double nearest = INFINITY;
    for (const double t : cameras[1].time_s) nearest = std::min(nearest, std::abs(t - static_cast<double>(i) * kPeriod));
    EXPECT_NEAR(std::abs(b.residual_s[i]), nearest, 1e-9);
  }
  EXPECT_EQ(c.status, ClockStatus::kNoTime);
  EXPECT_TRUE(TimeStepsOfFrames(c).empty());
  TimelineOptions options;
  options.reference = "c";
  EXPECT_THROW(BuildTimeline(cameras, TimelineClock::kCommon, nullptr, options), FormatError);
  options.reference = "nobody";
  EXPECT_THROW(BuildTimeline(cameras, TimelineClock::kCommon, nullptr, options), UsageError);
  cameras[0].time_s.back() = 1e11;
  EXPECT_THROW(BuildTimeline({cameras[0], cameras[0]}, TimelineClock::kCommon, nullptr), UsageError);
  EXPECT_THROW(BuildTimeline({cameras[0]}, TimelineClock::kCommon, nullptr), FormatError);
}

TEST(Timeline, NumberedImagesKeepTheirNumbers) {
  CameraTimes a{"a", "a", {}, {}, {}, 0.0}, b = a;
  b.camera = "b";
  for (const int64_t n : {5, 6, 7, 9, 10, 14}) a.frame.push_back(n), a.time_s.push_back(static_cast<double>(n) / 30);
  for (const int64_t n : {0, 1, 2, 3, 5, 6, 7, 8, 9, 10}) b.frame.push_back(n), b.time_s.push_back(static_cast<double>(n) / 30);
  const Timeline timeline = BuildTimeline({a, b}, TimelineClock::kStart, nullptr);
  EXPECT_EQ(timeline.cameras[0].frame_at, (std::vector<int64_t>{-1, -1, -1, -1, -1, 5, 6, 7, -1, 9, 10}));
  EXPECT_EQ(timeline.cameras[1].frame_at, (std::vector<int64_t>{0, 1, 2, 3, -1, 5, 6, 7, 8, 9, 10}));
  EXPECT_NEAR(timeline.cameras[1].offset_frames, 0, 1e-9);
}

TEST(Timeline, ImagesOnACommonClockKeepTheirNumbers) {
  CameraTimes a{"a", "a", {}, {}, {}, std::nullopt}, b = a;
  b.camera = "b";
  for (const int64_t n : {245, 246, 248, 249, 250}) a.frame.push_back(n), a.time_s.push_back(3 + static_cast<double>(n) / 30);
  for (int64_t n = 11; n < 20; ++n) b.frame.push_back(n), b.time_s.push_back(3 + static_cast<double>(n + 232) / 30);
  const Timeline timeline = BuildTimeline({a, b}, TimelineClock::kCommon, nullptr);
  ASSERT_EQ(timeline.num_time_steps, 251);
  for (const int64_t n : {245, 246, 248, 249, 250}) EXPECT_EQ(timeline.cameras[0].frame_at[static_cast<size_t>(n)], n);
  EXPECT_EQ(timeline.cameras[0].frame_at[247], -1);
  EXPECT_EQ(timeline.cameras[0].frame_at[244], -1);
  for (int64_t n = 243; n <= 250; ++n) EXPECT_EQ(timeline.cameras[1].frame_at[static_cast<size_t>(n)], n - 232);
  EXPECT_NEAR(timeline.cameras[1].offset_frames, -232, 1e-6);
  EXPECT_NEAR(timeline.cameras[0].offset_frames, 0, 1e-6);
}

TEST(TimelineFile, ThereAndBackAndDamaged) {
  const TempDir folder;
  const Faults faults{0.05, 0.02, 0.001, 0};
  Timeline timeline =
      BuildTimeline(TimesOf({Film("a", 3, kPeriod, 200, faults, 1), Film("b\"é", 3.1, kPeriod, 200, faults, 2)}),
                    TimelineClock::kCommon, nullptr);
  timeline.take = "take 1";
  const std::string path = folder / "t.timeline.json";
  WriteTimeline(timeline, path);
  const Timeline back = ReadTimeline(path);
  ASSERT_EQ(back.cameras.size(), 2u);
  EXPECT_EQ(back.take, timeline.take);
  EXPECT_EQ(back.reference, "a");
  EXPECT_EQ(back.clock, TimelineClock::kCommon);
  EXPECT_EQ(back.start_s, timeline.start_s);
  for (size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(back.cameras[c].frame_at, timeline.cameras[c].frame_at);
    EXPECT_EQ(back.cameras[c].doubled, timeline.cameras[c].doubled);
    EXPECT_EQ(back.cameras[c].offset_frames, timeline.cameras[c].offset_frames);
    EXPECT_EQ(FoundDrops(back.cameras[c]), FoundDrops(timeline.cameras[c]));
  }
  const std::string text = ReadFile(path);
  WriteTimeline(back, folder / "again.json");
  EXPECT_EQ(ReadFile(folder / "again.json"), text);
  for (size_t keep = 0; keep + 2 < text.size(); keep += 7) {
    std::ofstream(folder / "cut.json") << text.substr(0, keep);
    EXPECT_THROW(ReadTimeline(folder / "cut.json"), FormatError) << keep;
  }
  const auto refused = [&](const std::string& from, const std::string& to) {
    std::string bad = text;
    bad.replace(bad.find(from), from.size(), to);
    std::ofstream(folder / "bad.json") << bad;
    return MessageOf<FormatError>([&] { ReadTimeline(folder / "bad.json"); });
  };
  EXPECT_NE(refused("\"num_instants\": ", "\"num_instants\": 9999999").find("num_instants"), std::string::npos);
  EXPECT_NE(refused("\"reference\": \"a\"", "\"reference\": \"x\"").find("reference"), std::string::npos);
  EXPECT_NE(refused("\"common\"", "\"ours\"").find("clock"), std::string::npos);
}

/// The same faults, but in files.
TEST(TimelineOfVideos, DroppedAndRepeatedFrames) {
  const TempDir folder;
  const std::vector<int> dropped = {9, 10, 25}, repeated = {17};
  mvstudio::testing::ClipOptions b_frames;
  b_frames.b_frames = 2;
  for (const char* name : {"a.mp4", "b.mkv"}) {
    std::vector<int64_t> pts;
    std::vector<int> codes;
    for (int n = 0; n < 40; ++n) {
      const bool lossy = std::string(name) == "b.mkv";
      if (lossy && std::count(dropped.begin(), dropped.end(), n)) continue;
      pts.push_back(3003 * n);
      codes.push_back(lossy && std::count(repeated.begin(), repeated.end(), n) ? n - 1 : n);
    }
    mvstudio::testing::WriteClip(folder / name, pts, b_frames, codes);
  }
  std::vector<CameraTimes> times = {ReadFootageTimes("a", folder / "a.mp4", 30), ReadFootageTimes("b", folder / "b.mkv", 30)};
  EXPECT_TRUE(FindRepeats(folder / "a.mp4").empty());
  times[1].repeats = FindRepeats(folder / "b.mkv");
  EXPECT_EQ(times[1].repeats, std::vector<int64_t>{15});  // two were dropped before it
  const Timeline timeline = BuildTimeline(times, TimelineClock::kStart, nullptr);
  ASSERT_EQ(timeline.num_time_steps, 40);
  EXPECT_NEAR(timeline.fps_hz, 29.97, 1e-3);
  const CameraTimeline& b = timeline.cameras[1];
  EXPECT_EQ(FoundDrops(b), 3);
  int64_t frame = 0;
  for (int n = 0; n < 40; ++n) {
    const bool gone = std::count(dropped.begin(), dropped.end(), n), twice = std::count(repeated.begin(), repeated.end(), n);
    EXPECT_EQ(b.frame_at[static_cast<size_t>(n)], gone || twice ? -1 : frame) << n;
    frame += !gone;
    EXPECT_EQ(timeline.cameras[0].frame_at[static_cast<size_t>(n)], n);
  }
}

/// A session's folder may be given under several names; its timeline is one file.
TEST(TimelineOfVideos, NamesFootageAsTheSessionDoes) {
  const TempDir folder;
  std::filesystem::create_directory(folder / "day");
  std::filesystem::create_directory_symlink(".", folder / "day/back");
  for (const char* name : {"day/b.mp4", "day/a.mp4"}) mvstudio::testing::WriteClip(folder / name, {0, 3003, 6006});
  Session session;
  session.cameras = {{"a", "", "", 0, 0}, {"b", "", "", 0, 0}};
  SessionTake take;
  take.footage = {{"a", "a.mp4", ""}, {"b", "b.mp4", ""}};
  for (const char* name : {"day", "day/back"}) {
    session.folder = folder / name;
    const Timeline timeline = BuildTakeTimeline(session, take, {}).timeline;
    ASSERT_EQ(timeline.cameras.size(), 2u);
    for (const CameraTimeline& camera : timeline.cameras) EXPECT_EQ(camera.source, camera.name + ".mp4") << name;
  }
}

/// A take too short for `sync` has a file without any offset. That is no reason to have no timeline.
TEST(TimelineOfVideos, AFileThatKnowsNoOffsetCountsAsNone) {
  const TempDir folder;
  for (const char* name : {"a.mp4", "b.mp4"}) mvstudio::testing::WriteClip(folder / name, {0, 3003, 6006});
  Session session;
  session.folder = folder.path();
  session.cameras = {{"a", "", "", 0, 0}, {"b", "", "", 0, 0}};
  SessionTake take;
  take.footage = {{"a", "a.mp4", ""}, {"b", "b.mp4", ""}};
  take.sync = "sync.json";
  const auto built = [&](const std::string& of_b) {
    const std::string unknown = R"("status": "TooFewDetections", "offset_frames": null, "sigma_frames": null})";
    std::ofstream(folder / "sync.json") << R"({"schema": "mvstudio.sync/1", "reference": "b", "fps": 29.97, "cameras": [)"
                                        << R"({"name": "a", )" << unknown << R"(, {"name": "b", )"
                                        << (of_b.empty() ? unknown : of_b) << "]}";
    return BuildTakeTimeline(session, take, {});
  };
  const TakeTimeline none = built("");
  EXPECT_EQ(none.timeline.clock, TimelineClock::kStart);
  EXPECT_EQ(none.timeline.num_time_steps, 3);
  ASSERT_FALSE(none.notes.empty());
  EXPECT_NE(none.notes[0].find("knows the offset of no camera"), std::string::npos) << none.notes[0];
  const TakeTimeline one = built(R"("status": "Ok", "offset_frames": 0, "sigma_frames": 0.1})");
  EXPECT_EQ(one.timeline.clock, TimelineClock::kOffsets) << "the other camera is left out";
  EXPECT_EQ(one.timeline.Find("a")->status, ClockStatus::kNoOffset);
}

TEST(Timestamps, TablesAndWhatIsWrongWithThem) {
  const TempDir folder;
  const std::vector<SessionCamera> cameras = {{"left", "77", "", 0, 0}, {"cam_02", "", "", 0, 0}};
  const auto read = [&](const std::string& text) {
    std::ofstream(folder / "t.csv") << text;
    std::vector<CameraTimes> times = {{"left", "", {0, 1, 2}, {0, 0, 0}, {}, std::nullopt},
                                      {"cam_02", "", {4, 5}, {0, 0}, {}, std::nullopt}};
    ReadTimestamps(folder / "t.csv", cameras, &times);
    return times;
  };
  const auto times = read("camera,frame,time_ms\n77,0,1000\n77,2,1066\n2,5,1040\n2,4,1006.5\nother,9,1\n");
  EXPECT_EQ(times[0].time_s[0], 1);
  EXPECT_TRUE(std::isnan(times[0].time_s[1]));
  EXPECT_EQ(times[1].time_s, (std::vector<double>{1.0065, 1.04}));
  EXPECT_EQ(read("sync_index,cam_id,frame_time\n1,2,7\n0,2,6\n0,77,1\n1,77,2\n1,left,3\n")[1].time_s,
            (std::vector<double>{6, 7}));
  EXPECT_EQ(read("camera,frame,time\nleft,8,2\nleft,7,1\nleft,9,3\n2,4,6\n2,5,7\n")[0].time_s,
            (std::vector<double>{1, 2, 3}));  // the recorder began to count before it wrote
  const auto wrong = [&](const std::string& text) { return MessageOf<FormatError>([&] { read(text); }); };
  EXPECT_NE(wrong("camera,frame,time\nleft,8,1\nleft,7,2\nleft,9,3\n2,4,6\n2,5,7\n").find("frame 7"), std::string::npos);
  EXPECT_NE(wrong("").find("empty"), std::string::npos);
  EXPECT_NE(wrong("frame,time\n").find("cameras"), std::string::npos);
  EXPECT_NE(wrong("camera,frame\n").find("times"), std::string::npos);
  EXPECT_NE(wrong("camera,time\nleft,x\n").find("line 2"), std::string::npos);
  EXPECT_NE(wrong("camera,time\nleft\n").find("line 2"), std::string::npos);
  EXPECT_NE(wrong("camera,time\nleft,1\nleft,2\nleft,3\n").find("camera cam_02"), std::string::npos);
  EXPECT_NE(wrong("camera,time\nleft,1\nleft,2\n2,1\n2,2\n").find("2 times"), std::string::npos);
  EXPECT_NE(wrong("camera,frame,time\nleft,7,1\n2,4,2\n").find("frame 7"), std::string::npos);
  EXPECT_NE(wrong("camera,frame,time\nleft,1,1\nleft,1,2\n2,4,2\n").find("twice"), std::string::npos);
}

/// caliscope groups the frames of its webcams into time steps while it records; its groups are the peer's opinion, not truth.
TEST(Timestamps, RealWebcamsAgainstTheGroupsOfTheRecorder) {
  MVS_NEEDS_DATA("caliscope");
  const std::string folder = DataFolder("caliscope/sessions/charuco_calibration/calibration/extrinsic");
  std::vector<SessionCamera> cameras;
  std::vector<CameraTimes> times;
  for (int c = 0; c < 4; ++c) {
    const std::string name = "cam_" + std::to_string(c);
    cameras.push_back({name, "", "", 0, 0});
    times.push_back(ReadFootageTimes(name, folder + "/" + name + ".mp4", 30));
  }
  EXPECT_EQ(ReadTimestamps(folder + "/timestamps.csv", cameras, &times).size(), 4u);  // its frames are 26 to 136
  const Timeline timeline = BuildTimeline(times, TimelineClock::kCommon, nullptr);
  std::ifstream in(folder + "/timestamps.csv");
  std::string line;
  std::getline(in, line);
  std::map<int, std::map<int, int64_t>> groups;  // sync index -> camera -> frame
  for (int sync, camera, frame; std::getline(in, line) && std::sscanf(line.c_str(), "%d,%d,%d", &sync, &camera, &frame) == 3;) {
    groups[sync][camera] = frame - 26;
  }
  int same = 0, compared = 0;
  for (size_t i = 0; i < timeline.cameras[0].frame_at.size(); ++i) {
    for (const auto& [sync, group] : groups) {
      if (!group.count(0) || group.at(0) != timeline.cameras[0].frame_at[i]) continue;
      for (const auto& [camera, frame] : group) {
        if (camera == 0) continue;
        ++compared;
        same += timeline.cameras[static_cast<size_t>(camera)].frame_at[i] == frame;
      }
    }
  }
  for (const CameraTimeline& c : timeline.cameras) {
    std::printf(
        "%s %s: %.4f Hz, offset %.3f frames, jitter %.2f ms, dropped %d, doubled %zu, residual median %.2f max %.2f ms\n",
        c.name.c_str(), std::string(ToString(c.status)).c_str(), c.fps_hz, c.offset_frames, c.jitter_ms,
        static_cast<int>(FoundDrops(c)), c.doubled.size(), c.residual_median_ms, c.residual_max_ms);
  }
  std::printf("same frames as the recorder's groups: %d of %d\n", same, compared);
  EXPECT_GT(compared, 300);
  EXPECT_GT(same, compared * 95 / 100);
}

}  // namespace
}  // namespace mvstudio::dataset
