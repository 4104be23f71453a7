# spisim on the CPU: docker build -t spisim . && docker run --rm -v "$PWD:/work" spisim demo -o out
FROM python:3.12-slim

WORKDIR /src
COPY pyproject.toml README.md LICENSE ./
COPY spisim spisim
COPY reconstruction reconstruction
COPY app app
COPY scenes scenes
COPY formats formats
COPY paper paper
COPY serving serving
COPY compare compare
COPY inverse inverse
COPY live live
COPY tools/wheel_scenes.py tools/wheel_scenes.py
COPY studies studies
COPY examples examples
RUN pip install --no-cache-dir '.[data]' && rm -rf /src

RUN useradd --create-home flyer
USER flyer
WORKDIR /work
ENTRYPOINT ["spisim"]
CMD ["--help"]
