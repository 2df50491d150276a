/* Formats that the loop-back device does not know: samples packed as on the camera's bus (MIPI CSI-2). */
{
	.name = "10 bpp greyscale, packed",
	.fourcc = v4l2_fourcc('Y', '1', '0', 'P'),
	.depth = 10,
	.flags = 0,
},
{
	.name = "12 bpp greyscale, packed",
	.fourcc = v4l2_fourcc('Y', '1', '2', 'P'),
	.depth = 12,
	.flags = 0,
},
