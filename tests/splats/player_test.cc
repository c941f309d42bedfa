#include <cmath>
#include <cstring>
#include <limits>

#include "avatar/splats/colour.h"
#include "avatar/splats/files/player_file.h"
#include "avatar/splats/place.h"
#include "avatar/splats/train/initial.h"
#include "core/error.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

/// A small mannequin with Gaussians, at time steps in which it moves along x.
struct Moving {
  body::BodyTemplate body = body::MakeMannequin(1.75, 0.25);
  Cloud cloud = CoverBody(body, body::MannequinTextures(16, 2), 300, 1, 3);
  std::vector<Eigen::Matrix3Xf> posed;

  explicit Moving(int count) {
    for (int t = 0; t < count; ++t) {
      posed.push_back(body.vertices);
      posed.back().row(0).array() += 0.01f * static_cast<float>(t);
    }
  }
  std::vector<PlayerTimeStep> time_steps() const {
    std::vector<PlayerTimeStep> out;
    for (size_t t = 0; t < posed.size(); ++t) out.push_back({static_cast<int>(10 + 2 * t), &posed[t]});
    return out;
  }
  std::string Bytes(const PlayerLimits& limits = {}) const { return PlayerBytes(cloud, true, body, time_steps(), limits); }
};

/// The file's arrays, by the table of docs/formats.md.
struct Decoded {
  uint32_t n, faces, vertices, time_steps, mip;
  float low[3], high[3], up[3];
  std::vector<int32_t> frames;
  std::vector<uint32_t> corner, face;
  std::vector<uint16_t> mesh, place, offset;
  std::vector<uint8_t> looks;

  explicit Decoded(const std::string& bytes) {
    EXPECT_EQ(bytes.substr(0, 8), "MVGPLAY1");
    size_t at = 8;
    const auto take = [&](void* to, size_t size) {
      ASSERT_LE(at + size, bytes.size());
      std::memcpy(to, bytes.data() + at, size), at += size;
    };
    const auto array = [&](auto* to, size_t count) { to->resize(count), take(to->data(), count * sizeof((*to)[0])); };
    for (uint32_t* number : {&n, &faces, &vertices, &time_steps, &mip}) take(number, 4);
    for (float* vector : {low, high, up}) take(vector, 12);
    array(&frames, time_steps), array(&corner, 3 * faces), array(&face, n), array(&mesh, 3 * vertices * time_steps);
    array(&place, 2 * n), array(&offset, n), array(&looks, 11 * n);
    EXPECT_EQ(at, bytes.size());
  }
  Eigen::Vector3f Vertex(uint32_t time_step, uint32_t i) const {
    Eigen::Vector3f x;
    for (int k = 0; k < 3; ++k)
      x[k] = low[k] +
             (high[k] - low[k]) * static_cast<float>(mesh[3 * (time_step * vertices + i) + static_cast<uint32_t>(k)]) / 65535;
    return x;
  }
};

TEST(Player, HoldsTheGaussiansToATenthOfAMillimetre) {
  const Moving moving(3);
  const Decoded file(moving.Bytes());
  ASSERT_EQ(file.n, moving.cloud.size());
  EXPECT_EQ(file.frames, (std::vector<int32_t>{10, 12, 14}));
  EXPECT_EQ(file.mip, 1u);
  for (uint32_t t = 0; t < 3; ++t) {
    for (uint32_t i = 0; i < file.n; ++i) {
      const Placed<float> placed = PlaceSplat<float>(moving.cloud, i, {moving.body.faces, moving.posed[t]});
      const uint32_t* corner = &file.corner[3 * file.face[i]];
      const Eigen::Vector3f x0 = file.Vertex(t, corner[0]), x1 = file.Vertex(t, corner[1]), x2 = file.Vertex(t, corner[2]);
      const float p = static_cast<float>(file.place[2 * i]) / 65535 * 2 - 0.5f,
                  q = static_cast<float>(file.place[2 * i + 1]) / 65535 * 2 - 0.5f,
                  h = static_cast<float>(file.offset[i]) / 65535 * 0.2f - 0.1f;
      const Eigen::Vector3f normal = (x1 - x0).cross(x2 - x0).normalized();
      const Eigen::Vector3f mean = x0 + p * (x1 - x0) + q * (x2 - x0) + h * normal;
      ASSERT_LT((mean - placed.mean).norm(), 1e-4f) << i;
    }
  }
  for (uint32_t i = 0; i < file.n; ++i) {
    const float learned = std::exp(moving.cloud.values.log_scale[3 * i]);
    const float scale = std::sqrt(learned * learned + moving.cloud.filter_variance[i]);
    EXPECT_NEAR(10.0 * file.looks[11 * i] / 255 - 10, std::log(scale), 0.0201);
    EXPECT_NEAR(file.looks[11 * i + 8] / 255.0, std::clamp(0.5 + kBasis0 * moving.cloud.values.colour[12 * i], 0.0, 1.0),
                0.002);
  }
  EXPECT_EQ(Eigen::Vector3f(file.up[0], file.up[1], file.up[2]), Eigen::Vector3f(0, 0, 1));
}

TEST(Player, KeepsItsLimits) {
  const Moving moving(20);
  const size_t all = moving.Bytes().size(), one = 6 * static_cast<size_t>(moving.body.vertices.cols()) + 4;
  EXPECT_EQ(Decoded(moving.Bytes({all, 60})).time_steps, 20u);
  EXPECT_EQ(Decoded(moving.Bytes({all - 1, 60})).time_steps, 19u);
  const Decoded few(moving.Bytes({all, 3}));
  EXPECT_EQ(few.frames, (std::vector<int32_t>{10, 28, 48})) << "the first and the last among them";
  EXPECT_EQ(Decoded(moving.Bytes({all - 19 * one, 60})).frames, (std::vector<int32_t>{10}));
  EXPECT_TRUE(moving.Bytes({all - 19 * one - 1, 60}).empty());
  EXPECT_TRUE(moving.Bytes({all, 0}).empty());
  EXPECT_TRUE(PlayerBytes(moving.cloud, true, moving.body, {}).empty());
}

TEST(Player, LeavesOutWhatIsNotFinite) {
  Moving moving(3);
  moving.posed[1](2, 5) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(Decoded(moving.Bytes()).frames, (std::vector<int32_t>{10, 14}));
  moving.posed.push_back(Eigen::Matrix3Xf::Zero(3, 4));
  EXPECT_THROW(moving.Bytes(), ContractViolation);
}

TEST(Player, UpIsThatOfTheBody) {
  Moving moving(1);
  const Eigen::Matrix3f lying = Eigen::AngleAxisf(1.5f, Eigen::Vector3f::UnitX()).toRotationMatrix();
  moving.posed[0] = lying * moving.body.vertices;
  EXPECT_EQ(UpOf(moving.body, moving.time_steps()), Eigen::Vector3f(0, -1, 0)) << "of a world whose y points down";
  const Eigen::Matrix3f half = Eigen::AngleAxisf(0.7f, Eigen::Vector3f::UnitX()).toRotationMatrix();
  moving.posed[0] = half * moving.body.vertices;
  EXPECT_LT((UpOf(moving.body, moving.time_steps()) - half.col(2)).norm(), 0.2f);
}

}  // namespace
}  // namespace mvstudio::splats
