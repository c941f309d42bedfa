#include <cmath>
#include <cstring>

#include "avatar/splats/colour.h"
#include "avatar/splats/files/cloud_file.h"
#include "avatar/splats/files/ply.h"
#include "avatar/splats/train/initial.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "tests/splats/scenes.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::splats {
namespace {

PlySplats RandomPly(size_t n, int degree) {
  Rng rng(7);
  PlySplats s;
  s.degree = degree;
  const auto fill = [&](size_t width, std::vector<float>* array) {
    for (size_t i = 0; i < width * n; ++i) array->push_back(static_cast<float>(rng.Normal()));
  };
  fill(3, &s.xyz), fill(3, &s.normal), fill(3 * static_cast<size_t>(BasisSize(degree)), &s.colour), fill(1, &s.opacity);
  fill(3, &s.log_scale), fill(4, &s.rotation);
  return s;
}

void ExpectSame(const PlySplats& a, const PlySplats& b) {
  EXPECT_EQ(a.degree, b.degree);
  EXPECT_EQ(a.xyz, b.xyz);
  EXPECT_EQ(a.normal, b.normal);
  EXPECT_EQ(a.colour, b.colour);
  EXPECT_EQ(a.opacity, b.opacity);
  EXPECT_EQ(a.log_scale, b.log_scale);
  EXPECT_EQ(a.rotation, b.rotation);
}

TEST(Ply, IsReadBitForBit) {
  const mvstudio::testing::TempDir folder;
  for (int degree = 0; degree <= 2; ++degree) {
    const PlySplats s = RandomPly(17, degree);
    WritePly(s, folder / ("a" + std::to_string(degree) + ".ply"));
    ExpectSame(ReadPly(folder / ("a" + std::to_string(degree) + ".ply")), s);
  }
  ExpectSame(ParsePly(PlyBytes(RandomPly(0, 0)), "empty"), RandomPly(0, 0));
}

TEST(Ply, HasTheAttributesOfTheReferenceProgram) {
  const std::string bytes = PlyBytes(RandomPly(2, 1));
  const std::string expected =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\nproperty float f_dc_0\nproperty float f_dc_1\n"
      "property float f_dc_2\nproperty float f_rest_0\n";
  EXPECT_EQ(bytes.substr(0, expected.size()), expected);
  EXPECT_EQ(bytes.size() - bytes.find("end_header\n") - 11, 2 * 4 * (6 + 12 + 8u));
}

TEST(Ply, OtherProgramsMayOrderAndAdd) {
  std::string bytes = "ply\r\n";
  EXPECT_THROW(ParsePly(bytes, "x"), FormatError);
  bytes = "ply\nformat binary_little_endian 1.0\ncomment by another program\nelement vertex 1\n";
  const char* names[] = {"rot_0",  "rot_1",  "rot_2",  "rot_3", "more", "scale_0", "scale_1", "scale_2", "opacity",
                         "f_dc_2", "f_dc_1", "f_dc_0", "nx",    "ny",   "nz",      "z",       "y",       "x"};
  std::string numbers;
  float value = 0;
  for (const char* name : names) {
    bytes += std::string("property float ") + name + "\n";
    value += 1;
    numbers.append(reinterpret_cast<const char*>(&value), 4);
  }
  const PlySplats s = ParsePly(bytes + "end_header\n" + numbers, "other");
  EXPECT_EQ(s.xyz, (std::vector<float>{18, 17, 16}));
  EXPECT_EQ(s.colour, (std::vector<float>{12, 11, 10}));
  EXPECT_EQ(s.rotation, (std::vector<float>{1, 2, 3, 4}));
}

TEST(Ply, DegreeThreeIsCutToTwo) {
  std::string header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n", numbers;
  const auto add = [&](const std::string& name, float value) {
    header += "property float " + name + "\n";
    numbers.append(reinterpret_cast<const char*>(&value), 4);
  };
  for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                           "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    add(name, 1);
  for (int k = 0; k < 45; ++k) add("f_rest_" + std::to_string(k), static_cast<float>(k));
  const PlySplats s = ParsePly(header + "end_header\n" + numbers, "third");
  ASSERT_EQ(s.degree, 2);
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 8; ++k) EXPECT_EQ(s.colour[static_cast<size_t>(3 + 8 * c + k)], static_cast<float>(15 * c + k));
}

TEST(Ply, RefusesEveryCutAndDamage) {
  const std::string good = PlyBytes(RandomPly(3, 0));
  for (size_t size = 0; size < good.size(); ++size) EXPECT_THROW(ParsePly(good.substr(0, size), "cut"), FormatError) << size;
  EXPECT_THROW(ParsePly(good + "x", "longer"), FormatError);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bad = good;
    bad.replace(bad.find(from), from.size(), to);
    return bad;
  };
  for (const std::string& bad :
       {with("binary_little_endian", "binary_big_endian"), with("binary_little_endian", "ascii"),
        with("element vertex 3", "element vertex 4000000000"), with("element vertex 3", "element vertex -3"),
        with("element vertex 3", "element vertex 99999999999999999999"), with("element vertex 3", "element face 3"),
        with("element vertex 3", "element vertex 3\nelement face 0"), with("float opacity", "double opacity"),
        with("float opacity", "float x"), with("float opacity", "float other"), with("property float x", "list float x"),
        with("f_dc_2", "f_rest_0"), with("format binary_little_endian 1.0\n", "")})
    EXPECT_THROW(ParsePly(bad, "damaged"), FormatError) << bad.substr(0, 60);
  std::string nan = good;
  const float bad = std::nanf("");
  std::memcpy(nan.data() + nan.size() - 4, &bad, 4);
  EXPECT_THROW(ParsePly(nan, "nan"), FormatError);
  EXPECT_THROW(ReadPly("/nonexistent/a.ply"), IoError);
}

TEST(Ply, ShowsTheCloudInSpace) {
  testing::Scene scene = testing::RandomScene(9, 2, 3);
  const Cloud cloud = CloudCast<float>(scene.cloud);
  const Eigen::Matrix3Xf vertices = scene.vertices.cast<float>();
  const PlySplats s = ToPly(cloud, scene.faces, vertices);
  ASSERT_EQ(s.size(), 9u);
  const auto seen = ProjectSplats(CloudCast<double>(cloud), scene.surface(), scene.view(), {false, 1});
  for (const Splat<double>& splat : seen.splats) {
    const auto i = static_cast<size_t>(splat.index);
    const Eigen::Vector3d mean(s.xyz[3 * i], s.xyz[3 * i + 1], s.xyz[3 * i + 2]);
    const Eigen::Vector3d in_cam = scene.camera.cam_from_world * mean;
    EXPECT_NEAR(in_cam[2], splat.depth, 1e-5);
    EXPECT_NEAR(30 * in_cam[0] / in_cam[2] + scene.camera.camera.cx(), splat.x, 1e-3);
    EXPECT_NEAR(1 / (1 + std::exp(-s.opacity[i])), splat.opacity, 1e-5);
    // Colour as a viewer makes it: harmonics of the direction in the world.
    double basis[9];
    EvaluateBasis<double>((mean - scene.camera.CenterInWorld()).normalized(), 2, basis);
    for (size_t c = 0; c < 3; ++c) {
      double value = 0.5 + basis[0] * s.colour[27 * i + c];
      for (size_t k = 1; k < 9; ++k) value += basis[k] * s.colour[27 * i + 3 + 8 * c + k - 1];
      EXPECT_NEAR(std::max(value, 0.0), splat.rgb[c], 1e-4);
    }
    // Covariance as a viewer makes it.
    const Eigen::Quaterniond q(s.rotation[4 * i], s.rotation[4 * i + 1], s.rotation[4 * i + 2], s.rotation[4 * i + 3]);
    const Eigen::Vector3d scale =
        Eigen::Vector3d(s.log_scale[3 * i], s.log_scale[3 * i + 1], s.log_scale[3 * i + 2]).array().exp();
    const Eigen::Matrix3d half =
        scene.camera.cam_from_world.rotation.toRotationMatrix() * q.toRotationMatrix() * scale.asDiagonal();
    Eigen::Matrix<double, 2, 3> lens;
    lens << 30 / in_cam[2], 0, -30 * in_cam[0] / (in_cam[2] * in_cam[2]), 0, 30 / in_cam[2],
        -30 * in_cam[1] / (in_cam[2] * in_cam[2]);
    const Eigen::Matrix2d covariance = lens * half * half.transpose() * lens.transpose() + 0.3 * Eigen::Matrix2d::Identity();
    EXPECT_NEAR(covariance.inverse()(0, 0), splat.a, 1e-4 * std::abs(splat.a));
    EXPECT_NEAR(covariance.inverse()(0, 1), splat.b, 1e-4 * (std::abs(splat.a) + std::abs(splat.c)));
  }
}

TEST(Ply, LeavesOutWhatHasNoPlace) {
  testing::Scene scene = testing::RandomScene(4, 0, 3);
  Cloud cloud = CloudCast<float>(scene.cloud);
  scene.vertices.col(0) = scene.vertices.col(1);
  cloud.values.offset[2] = std::nanf("");
  EXPECT_EQ(ToPly(cloud, scene.faces, scene.vertices.cast<float>()).size(), 2u);
}

struct Kept {
  body::BodyTemplate body = body::MakeMannequin(1.75, 0.25);
  CloudFile file;

  Kept() {
    body::Textures textures = body::MannequinTextures(16, 2);
    file.cloud = CoverBody(body, textures, 200, 2, 3);
    Rng rng(5);
    for (float& value : file.cloud.values.colour) value = static_cast<float>(rng.Normal());
    for (float& value : file.cloud.filter_variance) value = static_cast<float>(rng.Uniform());
    file.mip = false, file.size_px = 96, file.step = 1234, file.seed = 9876543210123ull, file.train_s = 12.5;
  }
  int faces() const { return static_cast<int>(body.faces.cols()); }
};

TEST(CloudFile, IsReadBitForBit) {
  const mvstudio::testing::TempDir folder;
  const Kept kept;
  WriteCloud(kept.file, kept.body, folder / kCloudFileName);
  const CloudFile read = ReadCloud(folder / kCloudFileName, kept.faces());
  EXPECT_EQ(CloudFileBytes(read, kept.body), CloudFileBytes(kept.file, kept.body));
  EXPECT_EQ(read.cloud.values.colour, kept.file.cloud.values.colour);
  EXPECT_EQ(read.seed, kept.file.seed);
  EXPECT_EQ(read.train_s, 12.5);
  EXPECT_FALSE(read.mip);
}

/// Random bytes of a valid file replaced: refused, or read as something sound.
TEST(CloudFile, ChangedBytesAreRefusedOrSound) {
  const Kept kept;
  const std::string good_cloud = CloudFileBytes(kept.file, kept.body), good_ply = PlyBytes(RandomPly(20, 1));
  Rng rng(11);
  const auto damaged = [&](std::string bytes) {
    for (int64_t k = 0; k < 1 + rng.Index(4); ++k)
      bytes[static_cast<size_t>(rng.Index(static_cast<int64_t>(bytes.size())))] = static_cast<char>(rng.Index(256));
    return bytes;
  };
  int read = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    try {
      CheckCloud(ParseCloud(damaged(good_cloud), "changed", kept.faces()).cloud, kept.faces());
      ++read;
    } catch (const FormatError&) {
    }
    try {
      const PlySplats splats = ParsePly(damaged(good_ply), "changed");
      for (const float value : splats.colour) ASSERT_TRUE(std::isfinite(value));
      ++read;
    } catch (const FormatError&) {
    }
  }
  EXPECT_GT(read, 100);  // most changes of the numbers are legal ones
}

TEST(CloudFile, RefusesEveryCutAndDamage) {
  const Kept kept;
  const std::string good = CloudFileBytes(kept.file, kept.body);
  for (size_t size = 0; size < good.size(); size += 97)
    EXPECT_THROW(ParseCloud(good.substr(0, size), "cut", kept.faces()), FormatError);
  EXPECT_THROW(ParseCloud(good, "other body", 10), FormatError);
  CloudFile bad = kept.file;
  bad.cloud.values.offset[3] = std::nanf("");
  EXPECT_THROW(ParseCloud(CloudFileBytes(bad, kept.body), "nan", kept.faces()), FormatError);
  EXPECT_THROW(ParseCloud(NpzOf({{"schema", NpyOfTexts({kCloudSchema})}}), "little", kept.faces()), FormatError);
  EXPECT_THROW(ParseCloud(NpzOf({{"schema", NpyOfTexts({"mvstudio.gaussians/2"})}}), "newer", kept.faces()), FormatError);
  EXPECT_THROW(ReadCloud("/nonexistent/gaussians.npz", 3), IoError);
}

}  // namespace
}  // namespace mvstudio::splats
