#include "report/scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

#include "core/error.h"

namespace mvstudio::report {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Reads a chunk by the layout that scene.h states; it shares no code with the writer.
struct ChunkReader {
  explicit ChunkReader(std::string bytes_) : bytes(std::move(bytes_)) {
    first = Take<uint32_t>(), count = Take<uint32_t>(), people = Take<uint32_t>(), joints = Take<uint32_t>();
    for (uint32_t p = 0; p < people; ++p) {
      for (int i = 0; i < 4; ++i) lattice.push_back(Take<double>());
      widths.push_back(Take<uint32_t>());
      Take<uint32_t>();
    }
    for (uint32_t p = 0; p < people; ++p) {
      for (uint32_t i = 0; i < count * joints; ++i) cells.push_back(Record(p));
    }
  }

  template <class T>
  T Take() {
    T value{};
    EXPECT_LE(at + sizeof(T), bytes.size());
    if (at + sizeof(T) <= bytes.size()) std::memcpy(&value, &bytes[at], sizeof(T));
    at += sizeof(T);
    return value;
  }

  SceneJoint Record(uint32_t person) {
    SceneJoint joint;
    for (size_t i = 0; i < 3; ++i) {
      const uint32_t steps = widths[person] == 2 ? Take<uint16_t>() : Take<uint32_t>();
      const bool none = steps == (widths[person] == 2 ? 0xffffu : 0xffffffffu);
      joint.at_m[i] = none ? kNone : lattice[4 * person + i] + steps * lattice[4 * person + 3];
    }
    double sigma[3];
    for (double& s : sigma) {
      const int code = Take<uint8_t>();
      s = code == 0 ? kNone : 1e-6 * std::exp2((code - 1) / 8.0);
    }
    const double xy = Take<int8_t>() / 127.0, xz = Take<int8_t>() / 127.0, yz = Take<int8_t>() / 127.0;
    joint.covariance_m2 = {sigma[0] * sigma[0], xy * sigma[0] * sigma[1], xz * sigma[0] * sigma[2],
                           sigma[1] * sigma[1], yz * sigma[1] * sigma[2], sigma[2] * sigma[2]};
    joint.num_views = Take<uint8_t>();
    const int code = Take<uint8_t>();
    joint.rms_px = code == 0 ? kNone : 0.01 * std::exp2((code - 1) / 12.0);
    return joint;
  }

  std::string bytes;
  size_t at = 0;
  uint32_t first = 0, count = 0, people = 0, joints = 0;
  std::vector<double> lattice;
  std::vector<size_t> widths;
  std::vector<SceneJoint> cells;  ///< [person][time step][joint]
};

ScenePeople Empty(size_t steps, size_t people, size_t joints) {
  ScenePeople scene;
  for (size_t i = 0; i < steps; ++i) scene.frames.push_back(static_cast<int64_t>(i));
  for (size_t i = 0; i < people; ++i) scene.people.push_back(static_cast<int64_t>(i));
  for (size_t i = 0; i < joints; ++i) scene.joints.push_back("joint " + std::to_string(i));
  scene.cells.resize(steps * people * joints);
  return scene;
}

/// People that walk over `extent` metres, a tenth of the joints absent.
ScenePeople Walk(size_t steps, size_t people, size_t joints, double extent, double sigma, int seed) {
  ScenePeople scene = Empty(steps, people, joints);
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> uniform(0, 1);
  for (SceneJoint& cell : scene.cells) {
    if (uniform(random) < 0.1) continue;
    for (double& x : cell.at_m) x = 1000 + extent * uniform(random);
    const double a = sigma * (1 + uniform(random)), b = sigma * (1 + uniform(random)), c = sigma * (1 + uniform(random));
    cell.covariance_m2 = {a * a, 0.5 * a * b, -0.25 * a * c, b * b, 0.1 * b * c, c * c};
    cell.num_views = static_cast<int>(40 * uniform(random));
    cell.rms_px = 5 * uniform(random);
  }
  return scene;
}

void ExpectSame(const SceneJoint& got, const SceneJoint& want) {
  for (size_t i = 0; i < 3; ++i) {
    if (std::isnan(want.at_m[i])) {
      EXPECT_TRUE(std::isnan(got.at_m[i]));
      continue;
    }
    const double sigma = std::sqrt(want.covariance_m2[i == 0 ? 0 : i == 1 ? 3 : 5]);
    EXPECT_NEAR(got.at_m[i], want.at_m[i], std::min(0.1 * sigma, 1e-4));
    EXPECT_NEAR(std::sqrt(got.covariance_m2[i == 0 ? 0 : i == 1 ? 3 : 5]) / sigma, 1, 0.045);
  }
  if (std::isnan(want.at_m[0])) return;
  const auto correlation = [](const SceneJoint& j, size_t ab, size_t a, size_t b) {
    return j.covariance_m2[ab] / std::sqrt(j.covariance_m2[a] * j.covariance_m2[b]);
  };
  EXPECT_NEAR(correlation(got, 1, 0, 3), correlation(want, 1, 0, 3), 0.5 / 127 + 1e-9);
  EXPECT_NEAR(correlation(got, 2, 0, 5), correlation(want, 2, 0, 5), 0.5 / 127 + 1e-9);
  EXPECT_NEAR(correlation(got, 4, 3, 5), correlation(want, 4, 3, 5), 0.5 / 127 + 1e-9);
  EXPECT_EQ(got.num_views, want.num_views);
  EXPECT_NEAR(got.rms_px, want.rms_px, std::max(0.03 * want.rms_px, 0.01));
}

TEST(ScenePack, ComesBackWithinATenthOfSigma) {
  for (const double sigma : {1e-5, 2e-4, 0.003, 0.2}) {
    for (const double extent : {0.001, 3.0, 40.0}) {
      const ScenePeople scene = Walk(12, 3, 5, extent, sigma, 7);
      const ChunkReader chunk(PackPeople(scene, 2, 9));
      ASSERT_EQ(chunk.at, chunk.bytes.size());
      ASSERT_EQ(chunk.bytes.size(), PackedSize(9, 5, chunk.widths));
      EXPECT_EQ(chunk.first, 2u);
      EXPECT_EQ(chunk.count, 9u);
      for (size_t p = 0; p < 3; ++p) {
        for (size_t s = 0; s < 9; ++s) {
          for (size_t j = 0; j < 5; ++j) ExpectSame(chunk.cells[(p * 9 + s) * 5 + j], scene.At(2 + s, p, j));
        }
      }
    }
  }
}

TEST(ScenePack, TakesFourteenBytesAJointWhereAPersonMovesAFewMetres) {
  const ScenePeople scene = Walk(200, 3, 25, 6, 0.003, 3);
  EXPECT_EQ(PackPeople(scene, 0, 200).size(), 16u + 3 * 40 + 200u * 3 * 25 * 14);
  // 10,000 time steps of three people are then 14 MB of text.
  EXPECT_LT(10000.0 * 3 * 25 * 14 * 4 / 3, 14.1e6);
}

TEST(ScenePack, HugeFarAndDegenerateScenesStayFinite) {
  ScenePeople scene = Empty(2, 1, 3);
  scene.At(0, 0, 0).at_m = {0, 0, 0};
  scene.At(0, 0, 1).at_m = {1e6, -1e6, 5e6};
  scene.At(0, 0, 2).at_m = {1e300, 0, 0};  // no position that can be drawn
  scene.At(1, 0, 0).at_m = {std::numeric_limits<double>::infinity(), 1, 1};
  scene.At(1, 0, 1).at_m = {1, kNone, 1};
  scene.At(0, 0, 0).covariance_m2 = {-1, 0, 0, std::numeric_limits<double>::infinity(), 0, 0};
  scene.At(0, 0, 0).num_views = 100000;
  const ChunkReader chunk(PackPeople(scene, 0, 2));
  EXPECT_EQ(chunk.widths[0], 4u);
  EXPECT_NEAR(chunk.cells[1].at_m[2], 5e6, 1e-3);
  for (const size_t absent : {2, 3, 4, 5}) EXPECT_TRUE(std::isnan(chunk.cells[absent].at_m[0])) << absent;
  EXPECT_TRUE(std::isnan(chunk.cells[0].covariance_m2[0]));
  EXPECT_TRUE(std::isnan(chunk.cells[0].covariance_m2[3]));
  EXPECT_EQ(chunk.cells[0].num_views, 255);
  for (const double number : chunk.lattice) EXPECT_TRUE(std::isfinite(number));
}

TEST(ScenePack, ASingleCoincidentPointAndNobody) {
  ScenePeople scene = Empty(3, 1, 2);
  for (SceneJoint& cell : scene.cells) cell.at_m = {1.25, -2.5, 1e5};
  const ChunkReader chunk(PackPeople(scene, 0, 3));
  EXPECT_EQ(chunk.widths[0], 2u);
  for (const SceneJoint& cell : chunk.cells) EXPECT_EQ(cell.at_m, (std::array<double, 3>{1.25, -2.5, 1e5}));
  EXPECT_EQ(PackPeople(Empty(0, 0, 0), 0, 0).size(), 16u);
  const ChunkReader absent(PackPeople(Empty(2, 2, 2), 0, 2));
  for (const SceneJoint& cell : absent.cells) EXPECT_TRUE(std::isnan(cell.at_m[0]));
  EXPECT_THROW(PackPeople(scene, 2, 2), Error);
}

TEST(SceneSpans, EachNamesItsWorstTimeStep) {
  ScenePeople scene = Empty(10, 1, 2);
  for (size_t step = 0; step < 10; ++step) {
    for (size_t j = 0; j < 2; ++j) {
      if (step == 4) continue;
      scene.At(step, 0, j).at_m = {0, 0, 0};
      scene.At(step, 0, j).rms_px = step == 7 ? 3 + 4.0 * static_cast<double>(j) : 1;
    }
  }
  const std::vector<SceneSpan> spans = SpansOf(scene, 2);
  ASSERT_EQ(spans.size(), 2u);
  EXPECT_EQ(spans[0].first, 0u);
  EXPECT_EQ(spans[1].first, 5u);
  EXPECT_EQ(spans[1].worst, 7u);
  EXPECT_NEAR(spans[1].rms_px, std::sqrt((9 + 49) / 2.0), 1e-12);
  EXPECT_NEAR(spans[0].missing, 0.2, 1e-12);
  EXPECT_EQ(SpansOf(scene, 100).size(), 10u);
  EXPECT_EQ(spans[0].emptiest, 4u);
  EXPECT_EQ(SpansOf(scene, 100)[4].missing, 1);
  EXPECT_TRUE(std::isnan(SpansOf(scene, 100)[4].rms_px));
  EXPECT_TRUE(SpansOf(Empty(0, 0, 0), 5).empty());
}

}  // namespace
}  // namespace mvstudio::report
