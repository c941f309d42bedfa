#include <gtest/gtest.h>

#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/calib/format_samples.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::calib {
namespace {

using Format = CalibrationFormat;
using geometry::LensModel;
using geometry::Rig;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using testing::Carried;
using testing::ExpectSamePixels;
using testing::RandomRig;

struct Target {
  Format format;
  const char* name;    ///< file or folder
  size_t num_carried;  ///< of the ordinary lenses
};
constexpr Target kTargets[] = {
    {Format::kMvstudio, "a.json", 19},   {Format::kToml, "a.toml", 10},          {Format::kCaliscope, "a.toml", 10},
    {Format::kQca, "a.qca.txt", 7},      {Format::kOpenCvYaml, "yaml", 10},      {Format::kMrcal, "models", 11},
    {Format::kColmap, "sparse", 9},      {Format::kColmapText, "sparse_txt", 9}, {Format::kNerfstudio, "a.json", 7},
    {Format::kKalibr, "chain.yaml", 13}, {Format::kEasyMocap, "easymocap", 9}};

/// What the writer loses by design: nerfstudio reads one kind of lens.
bool Together(Format format, const geometry::Camera& camera) {
  return format != Format::kNerfstudio || camera.model != LensModel::kKannalaBrandt4;
}

TEST(RoundTrip, EveryFormatKeepsEveryPixel) {
  const TempDir folder;
  for (const Target& target : kTargets) {
    SCOPED_TRACE(ToString(target.format));
    for (const uint64_t seed : {1, 2, 3}) {
      const Rig rig = Carried(RandomRig(seed), target.format, [&](const auto& c) { return Together(target.format, c); });
      ASSERT_EQ(rig.cameras.size(), target.num_carried - (target.format == Format::kNerfstudio ? 1 : 0));
      const std::string path = folder / (std::to_string(seed) + target.name);
      const ExportReport report = WriteCalibration(rig, target.format, path);
      for (const std::string& file : report.files) EXPECT_TRUE(std::filesystem::exists(file)) << file;
      const Format detected = DetectFormat(target.format == Format::kOpenCvYaml ? report.files[0] : path);
      EXPECT_EQ(ToString(detected), ToString(target.format));
      ImportedRig imported = ReadCalibration(target.format, {path});
      // Files of a folder come back in the order of their names.
      Rig sorted;
      for (const auto& camera : rig.cameras) {
        const int found = imported.rig.Find(camera.camera.name);
        ASSERT_GE(found, 0) << camera.camera.name;
        sorted.cameras.push_back(imported.rig.cameras[found]);
      }
      const geometry::Rigid3 world = target.format == Format::kKalibr ? rig.cameras[0].cam_from_world : geometry::Rigid3();
      ExpectSamePixels(rig, sorted, 1e-9, world);
    }
  }
}

TEST(RoundTrip, NerfstudioFisheyes) {
  const TempDir folder;
  const Rig rig =
      Carried(RandomRig(4), Format::kNerfstudio, [](const auto& c) { return c.model == LensModel::kKannalaBrandt4; });
  ASSERT_EQ(rig.cameras.size(), 1u);
  WriteCalibration(rig, Format::kNerfstudio, folder / "transforms.json");
  ExpectSamePixels(rig, ReadCalibration(DetectFormat(folder.path()), {folder.path()}).rig, 1e-9);
}

TEST(RoundTrip, OpenCvStereoFileIsRelativeToTheLeftCamera) {
  const TempDir folder;
  Rig rig = Carried(RandomRig(5), Format::kOpenCvYaml, [](const auto& c) { return c.model != LensModel::kKannalaBrandt4; });
  rig.cameras.resize(2);
  rig.cameras[0].camera.name = "left", rig.cameras[1].camera.name = "right";
  rig.cameras[1].camera.width_px = rig.cameras[0].camera.width_px;
  rig.cameras[1].camera.height_px = rig.cameras[0].camera.height_px;
  WriteOptions millimetres;
  millimetres.metres_per_unit = 1e-3;
  ASSERT_EQ(WriteCalibration(rig, Format::kOpenCvYaml, folder / "stereo.yml", millimetres).files.size(), 1u);
  ReadOptions options;
  options.metres_per_unit = 1e-3;
  ExpectSamePixels(rig, ReadOpenCvYaml({folder / "stereo.yml"}, options).rig, 1e-9, rig.cameras[0].cam_from_world);
  rig = Carried(RandomRig(5), Format::kOpenCvYaml, [](const auto&) { return true; });
  EXPECT_THROW(WriteCalibration(rig, Format::kOpenCvYaml, folder / "many.yml"), UsageError);
}

TEST(RoundTrip, UnitsScaleTranslationsOnly) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(6), Format::kToml, [](const auto&) { return true; });
  WriteOptions millimetres;
  millimetres.metres_per_unit = 1e-3;
  WriteCalibration(rig, Format::kToml, folder / "mm.toml", millimetres);
  const Rig raw = ReadToml(folder / "mm.toml").rig;
  EXPECT_NEAR(raw.cameras[0].cam_from_world.translation.norm(), 1e3 * rig.cameras[0].cam_from_world.translation.norm(), 1e-9);
  ReadOptions options;
  options.metres_per_unit = 1e-3;
  ExpectSamePixels(rig, ReadToml(folder / "mm.toml", options).rig, 1e-9);
}

TEST(RoundTrip, ColmapPrincipalPointIsHalfAPixelOff) {
  const TempDir folder;
  Rig rig;
  rig.cameras.push_back({geometry::MakePinhole("a", 640, 480, 500), {}, {}, {}});
  WriteCalibration(rig, Format::kColmapText, folder / "m");
  EXPECT_NE(ReadFile(folder / "m/cameras.txt").find("1 PINHOLE 640 480 500.0 500.0 320.0 240.0\n"), std::string::npos);
  WriteCalibration(rig, Format::kNerfstudio, folder / "t.json");
  EXPECT_NE(ReadFile(folder / "t.json").find("\"cx\": 320.0, \"cy\": 240.0"), std::string::npos);
}

TEST(Lenses, AFormatThatCannotCarryOneSaysSo) {
  const TempDir folder;
  const Rig all = RandomRig(7);
  for (const Target& target : kTargets) {
    for (const auto& camera : all.cameras) {
      if (CanCarry(target.format, camera.camera)) continue;
      Rig rig;
      rig.cameras = {camera};
      const std::string message = MessageOf<FormatError>([&] { WriteCalibration(rig, target.format, folder / "no"); });
      EXPECT_NE(message.find(std::string(ToString(camera.camera.model)) + " cannot be written as " +
                             std::string(ToString(target.format))),
                std::string::npos)
          << message;
      EXPECT_FALSE(std::filesystem::exists(folder / "no"));
      break;  // each takes a search for the nearest lens
    }
  }
}

TEST(Lenses, AreApproximatedWhenThatIsAllowed) {
  const TempDir folder;
  const Rig all = RandomRig(7);
  int num_approximated = 0;
  for (const Target& target : kTargets) {
    for (const auto& camera : all.cameras) {
      // Seen in 90 degrees, which perspective lenses can follow.
      if (CanCarry(target.format, camera.camera) || camera.camera.model != LensModel::kRational8) continue;
      Rig rig;
      rig.cameras = {camera};
      WriteOptions options;
      options.allow_approximation_px = 2;
      const std::string path = folder / (std::string(ToString(target.format)) + target.name);
      const ExportReport report = WriteCalibration(rig, target.format, path, options);
      ASSERT_EQ(report.notes.at(0).code, "CAL-APPROXIMATED");
      const Rig back = ReadCalibration(target.format, {path}).rig;
      geometry::Rigid3 world;
      if (target.format == Format::kKalibr) world = camera.cam_from_world;
      ExpectSamePixels(rig, back, 2, world);
      // The stated error is the largest.
      const double stated = std::stod(report.notes[0].text.substr(report.notes[0].text.find("off by ") + 7));
      ExpectSamePixels(rig, back, 1.01 * stated, world);
      options.allow_approximation_px = 0.9 * stated;
      EXPECT_THROW(WriteCalibration(rig, target.format, path + "2", options), FormatError);
      ++num_approximated;
    }
  }
  EXPECT_EQ(num_approximated, 3);  // qca, nerfstudio, kalibr
}

/// The shortest text of a number.
std::string Text(double number) {
  char buffer[40];
  return std::string(buffer, std::to_chars(buffer, buffer + sizeof buffer, number).ptr);
}

struct Sample {
  Format format;
  std::vector<std::string> files;
  double fx;  ///< of the first camera
};

/// One calibration of each format, of a rig that it carries.
std::vector<Sample> Samples(const TempDir& folder) {
  std::vector<Sample> samples;
  for (const Target& target : kTargets) {
    if (target.format == Format::kMvstudio) continue;  // has tests of its own
    Rig rig = Carried(RandomRig(8), target.format, [&](const auto& c) { return Together(target.format, c); });
    if (target.format == Format::kMrcal) {
      std::swap(rig.cameras[0], rig.cameras[4]);
      rig.cameras.resize(1);
    } else {
      rig.cameras.resize(2);
    }
    const std::string path = folder / (std::string(ToString(target.format)) + target.name);
    samples.push_back({target.format, WriteCalibration(rig, target.format, path).files, rig.cameras[0].camera.fx()});
  }
  return samples;
}

/// Truncated, with random bytes, with NaN in the place of a number: a rig of valid cameras or an error of the contract.
TEST(Damaged, FilesAreRefusedOrRead) {
  const TempDir folder;
  Rng rng(1);
  for (const auto& [format, files, fx] : Samples(folder)) {
    ASSERT_GT(fx, 0);
    SCOPED_TRACE(ToString(format));
    const std::string& victim = files[files.size() > 2 ? 1 : 0];
    const std::string text = ReadFile(victim);
    const bool by_folder = format == Format::kColmap || format == Format::kColmapText || format == Format::kEasyMocap;
    const std::vector<std::string> paths =
        by_folder ? std::vector<std::string>{std::filesystem::path(victim).parent_path().string()} : files;
    int refused = 0;
    const auto attempt = [&](const std::string& damaged) {
      std::filesystem::remove(
          victim);  // a file that is truncated instead is flushed to the disk on closing by some file systems
      std::ofstream(victim, std::ios::binary) << damaged;
      try {
        for (const auto& camera : ReadCalibration(format, paths).rig.cameras) geometry::Validate(camera.camera);
      } catch (const FormatError& error) {
        ++refused;
        ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
        ASSERT_NE(std::string(error.what()).find(folder.path()), std::string::npos) << error.what();
      } catch (const UsageError&) {
        ++refused;
      }
    };
    for (int i = 0; i < 150; ++i) attempt(text.substr(0, static_cast<size_t>(rng.Index(static_cast<int64_t>(text.size())))));
    for (int i = 0; i < 150; ++i) {
      std::string damaged = text;
      damaged[static_cast<size_t>(rng.Index(static_cast<int64_t>(text.size())))] = static_cast<char>(rng.Index(256));
      attempt(damaged);
    }
    EXPECT_GT(refused, 100);
    std::ofstream(victim, std::ios::binary) << text;
  }
}

TEST(Damaged, NotANumberIsNamedWithItsPlace) {
  const TempDir folder;
  for (const auto& [format, files, fx] : Samples(folder)) {
    if (format == Format::kColmap) continue;
    SCOPED_TRACE(ToString(format));
    const std::string text = ReadFile(files[0]), number = Text(format == Format::kQca ? 64 * fx : fx);
    const size_t start = text.find(number);
    ASSERT_NE(start, std::string::npos) << number;
    for (const char* nan : {"nan", "inf", "1e999"}) {
      WriteFileAtomic(files[0], text.substr(0, start) + nan + text.substr(start + number.size()));
      const bool by_folder = format == Format::kColmapText || format == Format::kEasyMocap;
      const std::string message = MessageOf<FormatError>([&] {
        const std::string parent = std::filesystem::path(files[0]).parent_path().string();
        ReadCalibration(format, by_folder ? std::vector<std::string>{parent} : files);
      });
      EXPECT_EQ(message.rfind(files[0] + ": ", 0), 0u) << message;
    }
    WriteFileAtomic(files[0], text);
  }
}

TEST(Damaged, BinaryCountsAreNotTrusted) {
  const TempDir folder;
  Rig rig = Carried(RandomRig(9), Format::kColmap, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kColmap, folder / "m");
  for (const char* name : {"cameras.bin", "images.bin"}) {
    const std::string bytes = ReadFile(folder / "m/" + name);
    for (const uint64_t count : {uint64_t{1} << 60, ~uint64_t{0}, uint64_t{100}, uint64_t{1}}) {
      std::string damaged = bytes;
      std::memcpy(damaged.data(), &count, sizeof count);
      WriteFileAtomic(folder / "m/" + name, damaged);
      EXPECT_NE(MessageOf<FormatError>([&] { ReadColmap(folder / "m"); }).find(name), std::string::npos) << count;
    }
    std::string nan = bytes;
    std::memset(nan.data() + 40, 0xff, 8);
    WriteFileAtomic(folder / "m/" + name, nan);
    EXPECT_NE(MessageOf<FormatError>([&] { ReadColmap(folder / "m"); }).find("not finite"), std::string::npos);
    WriteFileAtomic(folder / "m/" + name, bytes);
  }
}

}  // namespace
}  // namespace mvstudio::calib
