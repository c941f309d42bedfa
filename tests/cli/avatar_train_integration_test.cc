#include <filesystem>

#include "core/disk/files.h"
#include "tests/avatar/panoptic_fixture.h"
#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// `avatar train` as a program: splits, validation, images, transfer, several processes.
namespace mvstudio {
namespace {

namespace fs = std::filesystem;

class AvatarTrain : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new testing::TempDir();
    avatar::WriteMannequinDataset(*folder_ / "data", 4, 8, 96);
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string data() { return *folder_ / "data"; }
  static std::string out(const std::string& name) { return *folder_ / name; }
  static std::vector<std::string> Joined(std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// A network that takes a second.
  static CliRun TrainTiny(const std::string& name, const std::vector<std::string>& more) {
    return RunCli(Joined({"avatar", "train", data(), "--out", out(name), "--json", "--threads", "2", "--size", "32", "--width",
                          "4", "--downs", "2", "--encoder-blocks", "1", "--decoder-blocks", "1", "--no-fit-shape"},
                         more));
  }
  static CliRun Train(const std::string& name, const std::vector<std::string>& more) {
    return TrainTiny(name, Joined({"--init-steps", "4", "--steps", "8", "--save-every", "2"}, more));
  }

  static testing::TempDir* folder_;
};
testing::TempDir* AvatarTrain::folder_ = nullptr;

TEST_F(AvatarTrain, TakesASplitFileAndNothingBesideIt) {
  const std::string split = out("split.json");
  ASSERT_EQ(RunCli({"dataset", "split", data(), "--test-cameras", "00_03", "--test-frames", "6-7", "--validation-cameras",
                    "00_02", "--validation-frames", "4-5", "--out", split})
                .exit,
            0);
  const CliRun run = Train("split", {"--split", split, "--patience", "1", "--learning-rate", "0", "--texture-learning-rate",
                                     "0", "--picture-every", "6"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto metrics = run.Json()["metrics"];
  EXPECT_EQ(metrics["train"]["frames"], 4);
  EXPECT_EQ(metrics["best_step"], 4) << "without learning the first check, at the end of the initialisation, is the best";
  EXPECT_EQ(metrics["steps"], 6);
  EXPECT_EQ(metrics["ended_early"], true);
  EXPECT_TRUE(fs::exists(out("split") + "/pictures/step_000006.png"));
  const auto config = nlohmann::json::parse(testing::Slurp(out("split") + "/config.json"))["split"];
  EXPECT_EQ(config["holdout_cameras"], nlohmann::json({"00_03"}));
  EXPECT_EQ(config["validation_frames"], nlohmann::json({4, 5}));
  const CliRun again = RunCli({"avatar", "resume", out("split"), "--json", "--patience", "50"});
  ASSERT_EQ(again.exit, 0) << again.err;
  EXPECT_EQ(again.Json()["metrics"]["steps"], 12);

  const CliRun both = Train("both", {"--split", split, "--holdout-cameras", "00_03"});
  EXPECT_EQ(both.exit, 2);
  EXPECT_THAT(both.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--split"));
  EXPECT_EQ(Train("both", {"--split", split, "--validate-camera", "00_00"}).exit, 2);
  EXPECT_EQ(Train("both", {"--split", data() + "/calibration_test.json"}).exit, 3);
}

TEST_F(AvatarTrain, AValidationCameraIsNotTrainedOn) {
  const CliRun run = Train("camera", {"--validate-camera", "00_01", "--ema", "0.9"});
  ASSERT_EQ(run.exit, 0) << run.err;
  const auto config = nlohmann::json::parse(testing::Slurp(out("camera") + "/config.json"))["split"];
  EXPECT_EQ(config["train_cameras"], nlohmann::json({"00_00", "00_02", "00_03"}));
  EXPECT_EQ(config["validation_cameras"], nlohmann::json({"00_01"}));
  EXPECT_THAT(testing::Slurp(out("camera") + "/history.csv"), HasSubstr("8,validation"));
  EXPECT_EQ(Train("none", {"--patience", "2"}).exit, 2);
  EXPECT_EQ(Train("none", {"--validate-camera", "nobody"}).exit, 2);
  EXPECT_EQ(Train("none", {"--amp", "--device", "cpu"}).exit, 2);
}

TEST_F(AvatarTrain, TakesABodyThatSawItsTrainingImagesAlone) {
  const std::vector<std::string> split = {"--holdout-cameras", "00_03", "--holdout-frames", "6-7"};
  const CliRun fit = RunCli(Joined({"avatar", "fit", data(), "--out", out("body")}, split));
  ASSERT_EQ(fit.exit, 0) << fit.err;
  const CliRun run = TrainTiny("with", Joined({"--body", out("body"), "--steps", "2"}, split));
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(testing::Slurp(out("with") + "/body.npz"), testing::Slurp(out("body") + "/body.npz"));
  const auto refused = [&](const std::vector<std::string>& more) {
    const CliRun other = TrainTiny("other", Joined({"--body", out("body") + "/body.npz", "--steps", "0"}, more));
    EXPECT_EQ(other.exit, 2);
    return other.Json()["errors"][0]["text"].get<std::string>();
  };
  EXPECT_THAT(refused({"--holdout-cameras", "00_01"}), HasSubstr("was fitted to camera 00_01"));
  EXPECT_THAT(refused({"--holdout-cameras", "00_03", "--holdout-frames", "2-3"}), HasSubstr("was fitted to frame 2"));
  EXPECT_THAT(refused(Joined(split, {"--pose-by", "joints"})), HasSubstr("was posed by images of frame 6"));
  EXPECT_THAT(refused(Joined(split, {"--fit", "girths"})), HasSubstr("--body needs"));
  EXPECT_FALSE(fs::exists(out("other")));
}

TEST_F(AvatarTrain, ANetworkThatAddsLittleIsLeftOutAndSaid) {
  const CliRun off = TrainTiny("little", {"--validate-camera", "00_01", "--steps", "2", "--learning-rate", "1e-9"});
  ASSERT_EQ(off.exit, 0) << off.err;
  EXPECT_EQ(off.Json()["metrics"]["network"]["kept"], false);
  const CliRun unjudged = TrainTiny("unjudged", {"--steps", "2", "--least-gain", "0.01"});
  EXPECT_EQ(unjudged.exit, 2);
}

TEST_F(AvatarTrain, BeginsWithAnotherAvatarsNetwork) {
  ASSERT_EQ(Train("first", {}).exit, 0);
  const std::vector<std::string> few = {"avatar",         "train",      data(),   "--out",           out("second"),
                                        "--init-from",    out("first"), "--json", "--train-cameras", "00_00",
                                        "--no-fit-shape", "--size",     "32",     "--steps",         "3"};
  const CliRun run = RunCli(few);
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["steps"], 3) << "no initialisation";
  EXPECT_EQ(run.Json()["metrics"]["num_parameters"],
            RunCli({"avatar", "info", out("first"), "--json"}).Json()["metrics"]["num_parameters"]);
  std::vector<std::string> wider = few;
  wider.insert(wider.end(), {"--overwrite", "--width", "6"});
  const CliRun refused = RunCli(wider);
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--width 6"));
  std::vector<std::string> usual = few;
  usual.insert(usual.end(), {"--overwrite", "--width", "16"});
  EXPECT_EQ(RunCli(usual).exit, 2) << "asked for, although it is the default";
}

TEST_F(AvatarTrain, DirectBeginsAtTheFittedBodyInItsColours) {
  const std::vector<std::string> direct = {"--method", "direct", "--holdout-cameras", "00_02", "--holdout-frames", "6-7"};
  ASSERT_EQ(TrainTiny("direct", Joined(direct, {"--steps", "0"})).exit, 0);
  const auto scores = RunCli({"avatar", "eval", out("direct"), "--features", "gabor", "--json"}).Json()["metrics"];
  const double network = scores["holdout"]["ssim"], body = scores["baselines"]["body_alone"]["ssim"];
  EXPECT_NEAR(network, body, 2e-3) << "8 bits and rounding";
  EXPECT_GT(body, 0.5);
  const CliRun refused = TrainTiny("colours", Joined(direct, {"--fit", "girths", "--template-colours"}));
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.Json()["errors"][0]["text"].get<std::string>(),
              AllOf(HasSubstr("--template-colours"), HasSubstr("--fit auto")));
  ASSERT_EQ(TrainTiny("outline", Joined(direct, {"--fit", "girths", "--steps", "0"})).exit, 0);
  EXPECT_EQ(RunCli({"avatar", "info", out("outline"), "--json"}).Json()["metrics"]["model"]["template-colours"], "0");
  const CliRun other = RunCli({"avatar", "train", data(), "--out", out("third"), "--init-from", out("direct"), "--fit",
                               "girths", "--size", "32", "--steps", "1", "--json"});
  EXPECT_EQ(other.exit, 2);
  EXPECT_THAT(other.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--init-from"));
}

TEST_F(AvatarTrain, AnOlderRunStaysUntilTheNewOneCanBeginAndItsScoresDoNotSurviveIt) {
  const std::vector<std::string> held_out = {"--holdout-cameras", "00_02", "--holdout-frames", "6-7"};
  const auto train = [&](const std::vector<std::string>& more) { return TrainTiny("again", Joined(held_out, more)); };
  const auto score = [] {
    ASSERT_EQ(RunCli({"avatar", "eval", out("again"), "--features", "gabor"}).exit, 0);
    ASSERT_TRUE(fs::exists(out("again") + "/avatar_eval.result.json"));
  };
  const auto scores = [] {
    return fs::exists(out("again") + "/avatar_eval.result.json") || fs::exists(out("again") + "/protocol.json") ||
           fs::exists(out("again") + "/eval");
  };
  ASSERT_EQ(train({"--steps", "1"}).exit, 0);
  score();
  const std::string checkpoint = testing::Slurp(out("again") + "/checkpoint.safetensors");
  for (const auto& impossible : {std::vector<std::string>{"--size", "34"}, {"--patience", "1"}, {"--amp", "--device", "cpu"}})
    EXPECT_EQ(train(Joined({"--steps", "1", "--overwrite"}, impossible)).exit, 2) << impossible[0];
  EXPECT_EQ(testing::Slurp(out("again") + "/checkpoint.safetensors"), checkpoint);
  EXPECT_TRUE(scores());
  EXPECT_EQ(RunCli({"avatar", "resume", out("again"), "--json"}).exit, 0);
  EXPECT_TRUE(scores()) << "there was nothing to do";
  ASSERT_EQ(RunCli({"avatar", "resume", out("again"), "--steps", "2", "--json"}).exit, 0);
  EXPECT_FALSE(scores()) << "they were of other weights";
  score();
  ASSERT_EQ(train({"--steps", "0", "--overwrite"}).exit, 0);
  EXPECT_FALSE(scores());
}

TEST_F(AvatarTrain, StartsFromTheTemplateUnlessToldOtherwise) {
  const auto first_phase = [](const std::string& name) {
    const std::string history = testing::Slurp(out(name) + "/history.csv");
    const size_t begin = history.find('\n') + 1;
    return history.substr(history.find(',', begin) + 1,
                          history.find(',', history.find(',', begin) + 1) - history.find(',', begin) - 1);
  };
  const auto train = [](const std::string& name, const std::vector<std::string>& more) {
    return TrainTiny(name, Joined({"--holdout-cameras", "00_02", "--holdout-frames", "6-7"}, more));
  };
  const CliRun template_run = train("template", {"--steps", "0"});
  ASSERT_EQ(template_run.exit, 0);
  EXPECT_EQ(template_run.Json()["metrics"]["body"]["camera_gains"].size(),
            template_run.Json()["metrics"]["train"]["cameras"].get<size_t>())
      << "the texture takes images of every camera";
  ASSERT_EQ(train("some", {"--steps", "3"}).exit, 0);
  ASSERT_EQ(train("bones", {"--steps", "3", "--prior", "none"}).exit, 0);
  EXPECT_EQ(first_phase("some"), "train");
  EXPECT_EQ(first_phase("bones"), "init");
  const auto scored = [](const std::string& name) {
    return RunCli({"avatar", "eval", out(name), "--features", "gabor", "--json"});
  };
  const CliRun own = scored("template"), bones = scored("bones");
  ASSERT_EQ(own.exit, 0) << own.err;
  ASSERT_EQ(bones.exit, 0) << bones.err;
  EXPECT_GT(own.Json()["metrics"]["holdout"]["mask_iou"].get<double>(), 0.9) << "the person is the template";
  EXPECT_LT(bones.Json()["metrics"]["holdout"]["mask_iou"].get<double>(), 0.7);
  const auto baselines = own.Json()["metrics"]["baselines"];
  EXPECT_GT(baselines["body_alone"]["mask_iou"].get<double>(), baselines["body_by_joints"]["mask_iou"].get<double>() - 0.005)
      << "images show no less than joints";
  EXPECT_THAT(own.Json()["warnings"].dump(), ::testing::Not(HasSubstr("AVA-NO-GAIN")));
  ASSERT_EQ(train("wild", {"--steps", "3", "--learning-rate", "0.5", "--clip-norm", "0"}).exit, 0);
  EXPECT_THAT(scored("wild").Json()["warnings"].dump(), HasSubstr("AVA-NO-GAIN")) << "a network that does harm";
  const CliRun labels = train("labels", {"--iuv", data(), "--prior", "template"});
  EXPECT_EQ(labels.exit, 2);
  EXPECT_THAT(labels.Json()["errors"][0]["text"].get<std::string>(), AllOf(HasSubstr("--iuv"), HasSubstr("--prior none")));
  EXPECT_EQ(train("labels", {"--prior", "some"}).exit, 2);
  EXPECT_EQ(train("joints", {"--steps", "0", "--pose-by", "joints"}).exit, 0);
  EXPECT_FALSE(scored("joints").Json()["metrics"]["baselines"].contains("body_by_joints")) << "it is the body as it is";
  EXPECT_EQ(train("girths", {"--fit", "girths", "--template", "mannequin"}).exit, 2) << "nothing would be fitted to it";
  const CliRun body = train("unknown", {"--template", "no-such-body"});
  EXPECT_EQ(body.exit, 2);
  EXPECT_THAT(body.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("--template no-such-body"));
}

TEST_F(AvatarTrain, TakesTheImagesThatExist) {
  const std::string sparse = out("sparse_data");
  fs::copy(data(), sparse, fs::copy_options::recursive);
  const auto remove = [&](const std::string& kind, const std::string& camera, int frame) {
    return fs::remove(sparse + "/" + kind + "/" + camera + "/" + camera + "_0000000" + std::to_string(frame) + ".png");
  };
  const auto train = [&](const std::vector<std::string>& more) {
    return RunCli(Joined({"avatar",
                          "train",
                          sparse,
                          "--out",
                          out("sparse"),
                          "--overwrite",
                          "--json",
                          "--threads",
                          "2",
                          "--size",
                          "32",
                          "--width",
                          "4",
                          "--downs",
                          "2",
                          "--encoder-blocks",
                          "1",
                          "--decoder-blocks",
                          "1",
                          "--no-fit-shape",
                          "--steps",
                          "1",
                          "--holdout-cameras",
                          "00_02",
                          "--holdout-frames",
                          "6-7"},
                         more));
  };
  ASSERT_TRUE(remove("hdImgs", "00_00", 3) && remove("masks", "00_01", 0) && remove("hdImgs", "00_02", 6));
  WriteFileAtomic(sparse + "/hdPose3d_stage1_coco19/body3DScene_00000005.json",
                  "{\"version\": 0.7, \"univTime\": 166.7, \"fpsType\": \"hd_29_97\", \"bodies\": []}");
  const CliRun run = train({});
  ASSERT_EQ(run.exit, 0) << run.out << run.err;
  const auto json = run.Json();
  EXPECT_EQ(json["status"], "warn");
  EXPECT_EQ(json["metrics"]["train"]["frames"], 5) << "not frame 5, in which nobody is";
  EXPECT_EQ(json["metrics"]["train"]["images"], 13);
  EXPECT_EQ(json["metrics"]["frames_without_person"], 1);
  EXPECT_EQ(json["metrics"]["missing"]["asked"], 15);
  EXPECT_EQ(json["metrics"]["missing"]["missing"], 2);
  EXPECT_EQ(json["metrics"]["missing"]["cameras"]["00_01"]["masks"], 1);
  EXPECT_EQ(json["metrics"]["missing"]["names"][0], "camera 00_00, frame 3: no image");
  ASSERT_GE(json["warnings"].size(), 3u) << json["warnings"].dump();
  EXPECT_EQ(json["warnings"][0]["code"], "AVA-MISSING");
  EXPECT_THAT(json["warnings"][0]["text"].get<std::string>(), AllOf(HasSubstr("2 of 15"), HasSubstr("00_00: 1 of 5")));
  EXPECT_THAT(json["warnings"][1]["text"].get<std::string>(), HasSubstr("held-out cameras in held-out frames: 1 of 2"));
  EXPECT_EQ(json["warnings"].back()["code"], "BODY-MISSING") << "whatever the fit says of the surface before";

  const CliRun eval = RunCli({"avatar", "eval", out("sparse"), "--features", "gabor", "--json"});
  ASSERT_EQ(eval.exit, 0) << eval.err;
  EXPECT_EQ(eval.Json()["metrics"]["holdout"]["n"], 1);
  EXPECT_EQ(eval.Json()["metrics"]["missing"]["missing"], 1);

  WriteFileAtomic(sparse + "/hdImgs/00_01/00_01_00000001.png", "damaged");
  EXPECT_EQ(train({}).exit, 3) << "what exists must be sound";
  ASSERT_TRUE(remove("hdImgs", "00_01", 1) && remove("hdImgs", "00_02", 7));
  const CliRun unscored = train({});
  EXPECT_EQ(unscored.exit, 3);
  EXPECT_THAT(unscored.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("held-out cameras in held-out frames"));
  for (const int frame : {0, 1, 2, 4}) remove("hdImgs", "00_00", frame);
  const CliRun without = train({});
  EXPECT_EQ(without.exit, 3);
  EXPECT_THAT(without.Json()["errors"][0]["text"].get<std::string>(), HasSubstr("camera 00_00: leave it out"));
}

TEST_F(AvatarTrain, SeveralProcessesTrainOneAvatar) {
  const CliRun run = Train("ranks", {"--ranks", "2"});
  ASSERT_EQ(run.exit, 0) << run.err;
  EXPECT_EQ(run.Json()["metrics"]["ranks"], 2);
  EXPECT_EQ(run.Json()["metrics"]["steps"], 12);
  for (const auto& entry : fs::directory_iterator(out("ranks")))
    EXPECT_TRUE(entry.path().filename() == ".mvstudio.json" || entry.path().filename().string()[0] != '.') << entry.path();
  const CliRun more = RunCli({"avatar", "resume", out("ranks"), "--steps", "10", "--json", "--threads", "2"});
  ASSERT_EQ(more.exit, 0) << more.err;
  EXPECT_EQ(more.Json()["metrics"]["steps"], 14);
  EXPECT_EQ(more.Json()["metrics"]["ranks"], 2) << "as before";
  EXPECT_EQ(RunCli({"avatar", "resume", out("ranks"), "--steps", "12", "--ranks", "1", "--json"}).exit, 2);
  EXPECT_EQ(Train("none", {"--ranks", "2", "--rank", "1"}).exit, 2);
  EXPECT_EQ(Train("none", {"--rank", "2", "--world-size", "2", "--rendezvous", out("meet")}).exit, 2);
}

}  // namespace
}  // namespace mvstudio
